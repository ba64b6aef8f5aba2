"""Former place of ``core.collision.solids``, kept until 0.3."""

from reachmap.core.collision.solids import SolidCell

__all__ = ["SolidCell"]
