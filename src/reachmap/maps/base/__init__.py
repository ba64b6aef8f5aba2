"""Placements of the robot base for a fixed bin: record and format."""
