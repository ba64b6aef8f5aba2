"""Standard streams that take any text, whatever the caller has left of them."""

from __future__ import annotations

import io
import os
import sys
from contextlib import suppress
from typing import Any, TextIO

STDIN, STDOUT, STDERR = 0, 1, 2


class AnswerError(OSError):
    """Standard output cannot be written: a full disk, say."""


class _Answer(io.FileIO):
    """Standard output whose failures are distinguished from those of other files."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            raise
        except OSError as error:
            raise AnswerError(error.errno, error.strerror) from error


class _Messages(io.RawIOBase):
    """Standard error that takes everything: a reader that went away stops no scan."""

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return STDERR

    def isatty(self) -> bool:
        return os.isatty(STDERR)

    def write(self, data: Any, /) -> int:
        with suppress(OSError):
            return os.write(STDERR, data)
        return len(data)


def prepare_streams() -> None:
    """Make the three standard streams usable.

    One that is closed leads to nowhere (or, worse, to the next file that is opened),
    so it is opened on the null device. What the console's encoding cannot spell is
    written as a backslash escape.
    """
    _open_closed_ones()
    sys.stdin = sys.stdin or open(STDIN, encoding="utf-8", closefd=False)  # noqa: SIM115
    out, err = _Answer(STDOUT, "w", closefd=False), _Messages()
    sys.stdout = _text(out, sys.stdout, line_buffering=out.isatty())
    sys.stderr = _text(err, sys.stderr, line_buffering=True)


def discard_stdout() -> None:
    """Let Python flush what is left of standard output, at exit, to nowhere."""
    null = os.open(os.devnull, os.O_WRONLY)
    try:
        # A captured stdout has no descriptor.
        with suppress(OSError, ValueError):
            os.dup2(null, sys.stdout.fileno())
    finally:
        os.close(null)


def _open_closed_ones() -> None:
    for descriptor in (STDIN, STDOUT, STDERR):
        try:
            os.fstat(descriptor)
        except OSError:
            null = os.open(os.devnull, os.O_RDWR)
            if null != descriptor:
                os.dup2(null, descriptor)
                os.close(null)


def _text(raw: io.RawIOBase, former: TextIO | None, *, line_buffering: bool) -> TextIO:
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=former.encoding if former else "utf-8",
        errors="backslashreplace",
        line_buffering=line_buffering,
    )
