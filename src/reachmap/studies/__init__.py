"""Studies: variants of a cell, what they reach, and which change is more than noise."""
