"""Grasp lists in formats that users already have, turned into native documents.

========================  ==============================  ==========================
Format                    Orientation and approach        Frame, unit
========================  ==============================  ==========================
``isaac_grasp`` (YAML)    quaternion; approach ``+z``     object, m
``graspnet`` (N×17)       matrix by rows; approach ``+x`` camera, m
``suction`` (N×7)         normal out of the surface       camera, m
``graspgen`` (JSON)       4×4 matrix; approach ``+z``     object, m
========================  ==============================  ==========================

None of them names a frame of the cell, so the caller says which it is.
"""
