"""Grasp lists, the nearest test grasp, the cost J, the re-ordering."""
