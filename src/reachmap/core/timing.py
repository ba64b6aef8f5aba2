"""Execution times, where 0.1 had them; now in ``core.planning.timing``."""

from reachmap.core.planning.timing import execution_time_s

__all__ = ["execution_time_s"]
