"""Robustness of a bin map: record, format and summary."""
