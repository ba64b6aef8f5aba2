"""Which modules a call walks through, by a profiler of calls."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import FrameType

ROOT = Path(__file__).parents[2]
TREES = ("src/reachmap/", "cli/")


@cache
def name_of(path: str) -> str:
    """Name of a source file from the root of the project; "" for others."""
    whole = Path(path).resolve()
    name = str(whole.relative_to(ROOT)) if whole.is_relative_to(ROOT) else ""
    return name if name.startswith(TREES) else ""


class Journey:
    """Files of the package that were entered; what runs on importing does not count.

    Parameters
    ----------
    unit : str
        A function, as in ``src/reachmap/scans/bin_scan.py:plan_unit``.

    Attributes
    ----------
    files, in_unit : set of str
        All of them, and those that were entered from the unit.
    """

    def __init__(self, unit: str = "") -> None:
        self.unit = unit
        self.files: set[str] = set()
        self.in_unit: set[str] = set()
        self._importing = self._depth = 0

    def note(self, frame: FrameType, event: str, argument: object) -> None:
        """Take an event; for ``sys.setprofile``."""
        code = frame.f_code
        step = {"call": 1, "return": -1}.get(event, 0)
        if code.co_name == "<module>":
            self._importing += step
        elif step and not self._importing and (name := name_of(code.co_filename)):
            if f"{name}:{code.co_name}" == self.unit:
                self._depth += step
            self.files.add(name)
            if self._depth:
                self.in_unit.add(name)


@contextmanager
def journey(unit: str = "") -> Iterator[Journey]:
    """Watch this thread for the length of the block."""
    found, before = Journey(unit), sys.getprofile()
    sys.setprofile(found.note)
    try:
        yield found
    finally:
        sys.setprofile(before)
