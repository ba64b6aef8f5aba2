"""The typed description of a cell: its sections, keys, ranges and defaults."""
