"""Former place of ``core.collision.bodies``, kept until 0.3."""

from reachmap.core.collision.bodies import build_geometry

__all__ = ["build_geometry"]
