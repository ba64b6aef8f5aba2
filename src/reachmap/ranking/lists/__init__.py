"""Grasp lists: reading, checking, importing from other formats."""
