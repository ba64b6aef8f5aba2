"""Robustness of a bin map: record, format, and what it says in numbers."""
