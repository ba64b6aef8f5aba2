"""Places of the arm for a bin that stands: record, and format."""
