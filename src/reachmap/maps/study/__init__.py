"""Studies of variants: record, format and summary."""
