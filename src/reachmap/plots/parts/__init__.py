"""What pictures share: style, squares, outlines, legends, files."""
