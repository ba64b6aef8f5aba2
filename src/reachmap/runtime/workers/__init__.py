"""Processes that do the units, and what happens when one dies."""
