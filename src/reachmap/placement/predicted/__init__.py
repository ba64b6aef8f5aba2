"""Bin poses scored from the workspace map alone."""
