"""Placement of the robot base for a fixed bin: mountings, candidates, the best."""
