"""How well a bin map predicts what planning to real grasps finds.

A grasp list is ranked by the map, each grasp is planned to as a picking loop would, and
the two are compared: :func:`plan_picks` measures, :func:`judge` compares.
"""
