"""Studies of variants: record, format, and what they say in numbers."""
