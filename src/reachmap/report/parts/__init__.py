"""Sections of the report, one a module."""
