"""Heaps of parts in a bin, and picking them to the end."""
