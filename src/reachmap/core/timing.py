"""Former place of ``core.planning.timing``, kept until 0.3."""

from reachmap.core.planning.timing import execution_time_s

__all__ = ["execution_time_s"]
