"""Placement of the bin, and the configuration that images it."""
