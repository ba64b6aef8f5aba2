"""Path-reachability maps for bin-picking cells.

A robot cell goes in, maps come out, and every later question is answered from a
map: where the bin goes, which grasps the arm really reaches, which to pick first.
"""

__version__ = "0.1.0"
