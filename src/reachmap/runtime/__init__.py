"""Units of work: run, kept, resumed, shared out over workers and machines."""
