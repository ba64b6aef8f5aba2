"""Running many tasks: units of work, workers, journal, progress."""
