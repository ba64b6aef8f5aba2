"""Files that a cell names: URDF, SRDF, joint limits, meshes, packages."""
