"""Forward and inverse kinematics, one solver a module."""

from reachmap.core.kinematics.kinematics import Kinematics

__all__ = ["Kinematics"]
