"""Where to look: lattices of points, families of tool orientations."""
