"""The errors a user may see, each with the exit code of the command line.

::

    ReachmapError                      exit code
    ├── CellError (ValueError)             2   a cell file, all its mistakes at once
    ├── SceneError (ValueError)            2   a cell that loads but cannot work
    ├── GraspListError (ValueError)        2   a grasp list
    ├── MapFileError (OSError)             2   an artefact or journal, as input
    ├── SettingsError (ValueError)         2   an option or argument
    ├── OutputError (OSError)              2   a place where nothing can be written
    │   └── NoRoomError                    2   the disk or a quota is full
    ├── MissingExtraError (ImportError)    2   an optional dependency
    ├── GateFailedError                    1   a requested gate did not hold
    ├── IncompleteError                    3   unfinished, can be resumed
    └── EngineError (RuntimeError)        70   a planner, solver or worker broke

"Unreachable" is not here: it is a result with a cause, never an exception.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar


class ReachmapError(Exception):
    """Base class; ``lines`` holds one sentence per mistake.

    Parameters
    ----------
    problems : str or iterable of str
        One line each: where, what was found, what was expected, what to do.
    """

    exit_code: ClassVar[int] = 2

    def __init__(self, problems: str | Iterable[str]) -> None:
        lines = (problems,) if isinstance(problems, str) else tuple(problems)
        super().__init__("\n".join(lines))
        self.lines: tuple[str, ...] = lines

    def __reduce__(self) -> tuple[type[ReachmapError], tuple[tuple[str, ...]]]:
        return (type(self), (self.lines,))


class CellError(ReachmapError, ValueError):
    """A cell file is wrong; every mistake is a line ``file:line:column: …``."""


class SceneError(ReachmapError, ValueError):
    """The cell loads, but cannot work: a scan configuration in collision, say."""


class GraspListError(ReachmapError, ValueError):
    """A grasp list cannot be read; the file and the grasp are named."""


class MapFileError(ReachmapError, OSError):
    """A file is not the artefact that was expected, or it is damaged."""


class SettingsError(ReachmapError, ValueError):
    """An option or argument is out of range or contradicts another."""


class OutputError(ReachmapError, OSError):
    """A result cannot be written: it exists, is in use, or the folder refuses."""


class NoRoomError(OutputError):
    """The disk, a quota or a file-size limit is full; a scan keeps its journal."""


class MissingExtraError(ReachmapError, ImportError):
    """An optional dependency is not installed; the message names the extra."""


class GateFailedError(ReachmapError):
    """The work is done, but a gate requested by the user failed."""

    exit_code: ClassVar[int] = 1


class IncompleteError(ReachmapError):
    """The work is unfinished; what is done is kept and the same command resumes."""

    exit_code: ClassVar[int] = 3


class EngineError(ReachmapError, RuntimeError):
    """A planner, solver or worker failed; this is a defect, not wrong input."""

    exit_code: ClassVar[int] = 70
