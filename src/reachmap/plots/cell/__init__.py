"""Pictures of the cell itself: a rasterised 3-D view."""
