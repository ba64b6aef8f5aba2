"""Where the arm goes for a bin that stands: mountings, places of the base, the best."""
