"""Numbers and names as people read them, in messages, tables, pictures; and where."""

from __future__ import annotations

import os
from typing import TextIO

ID_WIDTH = 16


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
