"""The kinematic model of the arm between base and TCP, and its limits."""

from reachmap.core.robot.model import RobotModel

__all__ = ["RobotModel"]
