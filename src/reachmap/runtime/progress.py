"""Progress on stderr: a bar on a terminal, else a plain line now and then."""

from __future__ import annotations

import math
import os
import shutil
import sys
import time
from collections import deque
from collections.abc import Callable
from typing import TextIO

LINE_INTERVAL_S = 30.0
BAR_INTERVAL_S = 0.1
RATE_WINDOW_S = 60.0
BAR_WIDTH = 24
ERASE_LINE = "\r\x1b[K"


class Progress:
    """Reports how far a run is: ``bin-scan 1890/7560 (25%) ok 93.1% 12.4/s …``.

    The time left comes from what remains and the rate of the last minute; frames
    that an earlier run did count as done but not for the rate.

    Parameters
    ----------
    label : str
        First word of the report.
    stream : text stream, optional
        By default stderr.
    clock : callable
        Seconds since any moment.
    quiet : bool
        Report nothing.
    terminal : bool, optional
        Draw a bar; by default when the stream is a terminal.
    """

    def __init__(
        self,
        label: str,
        *,
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
        quiet: bool = False,
        terminal: bool | None = None,
    ) -> None:
        self._label = label
        self._stream = sys.stderr if stream is None else stream
        self._clock = clock
        self._quiet = quiet
        self._bar = _is_terminal(self._stream) if terminal is None else terminal
        self._total = self._done = self._ok = 0
        self._started_s = self._shown_s = clock()
        self._shown_quarter = -1
        self._samples: deque[tuple[float, int]] = deque()

    def begin(self, total: int, *, done: int = 0, ok: int = 0) -> None:
        """Start the report.

        Parameters
        ----------
        total : int
            Frames there are.
        done, ok : int
            Frames an earlier run has done already, and how many of them well.
        """
        self._total, self._done, self._ok = total, done, ok
        self._started_s = self._clock()
        self._samples = deque([(self._started_s, done)])
        self._show()

    def expect(self, total: int) -> None:
        """Correct how many frames there are."""
        self._total = max(total, self._done)

    def add(self, frames: int, ok: int) -> None:
        """Count frames that were just done."""
        self._done += frames
        self._ok += ok
        self._samples.append((self._clock(), self._done))
        self.tick()

    def tick(self) -> None:
        """Report if it is time to."""
        if self._is_due():
            self._show()

    def end(self) -> None:
        """Finish the report; the bar stays as it was last."""
        if self._bar and not self._quiet:
            self._show()
            self._write("\n")

    def text(self) -> str:
        """One line of report."""
        share = self._done / self._total if self._total else 1.0
        parts = [
            f"{self._label} {self._done}/{self._total} ({math.floor(100 * share)}%)"
        ]
        if self._done:
            parts.append(f"ok {100 * self._ok / self._done:.1f}%")
        if rate := self._rate():
            parts.append(f"{rate:.0f}/s" if rate >= 100 else f"{rate:.3g}/s")
        parts.append(f"elapsed {clock_text(self._clock() - self._started_s)}")
        if rate and self._done < self._total:
            parts.append(f"ETA {clock_text((self._total - self._done) / rate)}")
        return " ".join(parts)

    def _rate(self) -> float:
        now = self._clock()
        while len(self._samples) > 2 and now - self._samples[1][0] > RATE_WINDOW_S:
            self._samples.popleft()
        if not self._samples:
            return 0.0
        first_s, first = self._samples[0]
        return (self._done - first) / (now - first_s) if now > first_s else 0.0

    def _is_due(self) -> bool:
        waited_s = self._clock() - self._shown_s
        if self._bar:
            return waited_s >= BAR_INTERVAL_S
        return waited_s >= LINE_INTERVAL_S or self._quarter() > self._shown_quarter

    def _quarter(self) -> int:
        return 4 * self._done // self._total if self._total else 4

    def _show(self) -> None:
        self._shown_s, self._shown_quarter = self._clock(), self._quarter()
        if self._quiet:
            return
        if not self._bar:
            self._write(f"{self.text()}\n")
            return
        filled = BAR_WIDTH * self._done // max(self._total, 1)
        bar = f"[{'#' * filled}{'.' * (BAR_WIDTH - filled)}] {self.text()}"
        width = shutil.get_terminal_size().columns - 1
        self._write(f"{ERASE_LINE}{bar[:width]}")

    def _write(self, text: str) -> None:
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):
            self._quiet = True  # nobody reads it any more; the run continues


def clock_text(seconds: float) -> str:
    """Seconds as minutes or hours.

    Examples
    --------
    >>> clock_text(152), clock_text(4000)
    ('2:32', '1:06:40')
    """
    minutes, second = divmod(round(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02}:{second:02}" if hours else f"{minute}:{second:02}"


def _is_terminal(stream: TextIO) -> bool:
    return stream.isatty() and os.environ.get("TERM") != "dumb"
