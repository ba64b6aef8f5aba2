"""Forward and inverse kinematics, one solver a module."""
