"""Units of work: run, stored, resumed, distributed over workers and machines."""
