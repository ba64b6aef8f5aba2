"""Scans: the outcome of every test frame and test grasp."""
