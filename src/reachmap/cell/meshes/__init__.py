"""Mesh files: STL, OBJ, PLY and COLLADA, each to the same triangles."""
