"""Ways to solve inverse kinematics: a module each, with a `Way` named ``WAY``."""
