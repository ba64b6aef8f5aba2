"""Curves: shares over attempts, over the height of parts, over errors."""
