"""The typed description of a cell: its sections, keys, ranges and defaults."""

from reachmap.cell.model.cell import Cell, RobotSpec

__all__ = ["Cell", "RobotSpec"]
