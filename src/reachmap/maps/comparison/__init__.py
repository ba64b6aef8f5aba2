"""Comparison of two maps of one kind, frame by frame."""
