"""Motions, planners, paths, their times, and the roadmap that joins them."""
