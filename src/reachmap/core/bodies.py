"""Bodies of a cell, where 0.1 had them; now in ``core.collision.bodies``."""

from reachmap.core.collision.bodies import build_geometry

__all__ = ["build_geometry"]
