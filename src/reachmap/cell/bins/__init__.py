"""Bins of a cell: carriers, filling, names, and what they stand on."""
