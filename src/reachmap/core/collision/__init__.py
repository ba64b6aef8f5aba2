"""Bodies and shapes, collision checks, displacement bounds, what the camera sees."""
