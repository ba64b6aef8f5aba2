"""The pick cycle of a bin map: its duration by stage, and where it ends early."""
