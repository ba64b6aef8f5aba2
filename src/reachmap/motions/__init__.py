"""Verified motions on their way out of a map: timed, and written for controllers."""
