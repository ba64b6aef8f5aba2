"""The look-up: nearest test grasp, cost J, order."""
