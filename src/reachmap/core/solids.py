"""Solids of a cell, where 0.1 had them; now in ``core.collision.solids``."""

from reachmap.core.collision.solids import SolidCell

__all__ = ["SolidCell"]
