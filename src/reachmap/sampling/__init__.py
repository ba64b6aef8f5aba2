"""What a scan tests: lattices of points, families of orientations, test frames.

Import from the modules: ``lattice`` needs NumPy only, the others the cell
description.
"""
