"""How well a bin map predicts planning to real grasps.

A grasp list is ranked by the map, each grasp is planned to as a picking loop would, and
the two are compared: :func:`plan_picks` measures, :func:`judge` compares.
"""
