"""Numbers and names as people read them, in messages, tables, pictures; and where."""

from __future__ import annotations

import math
import os
from typing import TextIO

# A choice: names of grasps in tables, in characters.
ID_WIDTH = 16
MINUS = "\N{MINUS SIGN}"
NONE = "\N{EN DASH}"


def percent_text(share: float) -> str:
    """A percentage with one decimal, "-" where there is none."""
    return "-" if share != share else f"{share:.1f}"


def count_text(count: int, total: int) -> str:
    """A count and its share: ``1204 (15.9 %)``."""
    return f"{count} ({100.0 * count / total:.1f} %)" if total else f"{count}"


def plural(count: int, noun: str) -> str:
    """A count and its noun: ``1 component``, ``5 components``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def printable(text: str, width: int = ID_WIDTH) -> str:
    """Spell an id from a file so that it cannot disturb a terminal."""
    safe = text if text.isprintable() else ascii(text)[1:-1]
    return safe if len(safe) <= width else safe[: width - 1] + "…"


def is_terminal(stream: TextIO) -> bool:
    """Whether a stream leads to a terminal that knows more than letters."""
    return stream.isatty() and os.environ.get("TERM") not in ("dumb", "unknown")


def number(value: float | None, digits: int, unit: str = "") -> str:
    """Fixed digits, a real minus, a dash for what is not known.

    Examples
    --------
    >>> number(-0.0004, 2, "m"), number(None, 1), number(2.5, 1, "%")
    ('0.00 m', '–', '2.5 %')
    """
    if value is None or not math.isfinite(value):
        return NONE
    rounded = round(value, digits) + 0.0
    said = f"{rounded:.{digits}f}".replace("-", MINUS)
    return f"{said} {unit}".rstrip()


def signed(value: float, digits: int, unit: str = "") -> str:
    """As :func:`number`, with the sign of positive numbers."""
    said = number(value, digits, unit)
    return f"+{said}" if round(value, digits) > 0 else said


def percent(value: float | None) -> str:
    """One decimal and the sign."""
    return number(value, 1, "%")


def interval(low: float, high: float) -> str:
    """Interval of a percentage.

    Examples
    --------
    >>> interval(93.9, 96.24)
    '93.9 to 96.2 %'
    """
    return f"{number(low, 1)} to {number(high, 1)} %"


def count(value: int, noun: str) -> str:
    """A count with its noun, thousands apart.

    Examples
    --------
    >>> count(1, "path"), count(7560, "test grasp")
    ('1 path', '7\u202f560 test grasps')
    """
    said = f"{value:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")
    return f"{said} {noun}" if value == 1 else f"{said} {noun}s"
