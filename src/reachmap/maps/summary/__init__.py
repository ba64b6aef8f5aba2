"""Figures of a map: Eq. (1), counts, causes, saturation."""
