"""Shared parts of pictures: style, squares, outlines, legends, files."""
