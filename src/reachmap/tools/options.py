"""Former place of ``runtime.options``, kept until 0.3."""

from reachmap.runtime.options import RunOptions

__all__ = ["RunOptions"]
