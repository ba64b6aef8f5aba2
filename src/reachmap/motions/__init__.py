"""Verified motions of a map: timed, and exported for controllers."""
