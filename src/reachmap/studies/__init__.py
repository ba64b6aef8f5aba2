"""Studies: variants of a cell, their objectives, and which changes are significant."""
