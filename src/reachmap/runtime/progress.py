"""Progress on stderr: a bar on a terminal, otherwise occasional lines."""

from __future__ import annotations

import math
import sys
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, TextIO

from reachmap.text import is_terminal

if TYPE_CHECKING:
    import rich.progress

# Choices: logs stay short, bars look alive, and rates are those of the last minute.
LINE_INTERVAL_S: Final = 30.0
BAR_INTERVAL_S: Final = 0.1
RATE_WINDOW_S: Final = 60.0
# The time left is shown once a rate has been watched for this long, and while its two
# halves agree to within this factor: a guess that jumps about is worse than none.
STEADY_AFTER_S: Final = 5.0
STEADY_FACTOR: Final = 2.0


class Progress:
    """Reports how far a stage of a run is: ``bin-scan 1890/7560 (25%) ok 93.1% …``.

    The time left comes from what remains and the rate of the last minute; frames
    that an earlier run did count as done but not for the rate. Nothing is said about
    it while the rate changes much.

    Parameters
    ----------
    label : str
        First words of the report: the command and its stage.
    stream : text stream, optional
        By default stderr.
    clock : callable
        Seconds since any moment.
    quiet : bool
        Report nothing.
    terminal : bool, optional
        Draw a bar; by default when the stream is a terminal that can.
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
        self._on_terminal = is_terminal(self._stream) if terminal is None else terminal
        self._bar: rich.progress.Progress | None = None
        self._total = self._done = self._ok = 0
        self._even = True
        self._started_s = self._shown_s = clock()
        self._shown_quarter = -1
        self._samples: deque[tuple[float, int]] = deque()

    def begin(
        self, total: int, *, done: int = 0, ok: int = 0, even: bool = True
    ) -> None:
        """Start the report.

        Parameters
        ----------
        total : int
            Frames there are.
        done, ok : int
            Frames an earlier run has done already, and how many of them well.
        even : bool
            False where the last frames take longer than the first, or the total is
            not certain: no time left is said then.
        """
        self._total, self._done, self._ok, self._even = total, done, ok, even
        self._started_s = self._clock()
        self._samples = deque([(self._started_s, done)])
        if self._on_terminal and not self._quiet:
            self._bar = _new_bar(self._stream)
            self._bar.add_task(self._label, total=total, status=self._status())
            self._write(self._bar.start)
        self._show()

    def expect(self, total: int) -> None:
        """Correct how many frames there are."""
        self._total = max(total, self._done)

    def add(self, frames: int, ok: int) -> None:
        """Count frames that were just finished."""
        self._done += frames
        self._ok += ok
        self._samples.append((self._clock(), self._done))
        self.tick()

    def add_rest(self) -> None:
        """Count the frames that remain as finished, none of them well."""
        self.add(self._total - self._done, 0)

    def tick(self) -> None:
        """Report if it is time to."""
        if self._is_due():
            self._show()

    def end(self) -> None:
        """Finish the report; the bar stays as it was last."""
        if self._bar is not None:
            self._show()
            self._write(self._bar.stop)
            self._bar = None

    def text(self) -> str:
        """One line of report."""
        return f"{self._label} {self._status()}"

    def _status(self) -> str:
        share = self._done / self._total if self._total else 1.0
        parts = [f"{self._done}/{self._total} ({math.floor(100 * share)}%)"]
        if self._done:
            parts.append(f"ok {100 * self._ok / self._done:.1f}%")
        if rate := self._rate():
            parts.append(f"{rate:.0f}/s" if rate >= 100 else f"{rate:.3g}/s")
        parts.append(f"elapsed {clock_text(self._clock() - self._started_s)}")
        if rate and self._done < self._total and self._is_steady():
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

    def _is_steady(self) -> bool:
        """Whether the older and the newer half of the last minute agree on a rate."""
        now, (first_s, first) = self._clock(), self._samples[0]
        if not self._even or now - first_s < STEADY_AFTER_S:
            return False
        half_s = (first_s + now) / 2
        middle_s, middle = min(self._samples, key=lambda one: abs(one[0] - half_s))
        if not first_s < middle_s < now:
            return False
        older = (middle - first) / (middle_s - first_s)
        newer = (self._done - middle) / (now - middle_s)
        return 0 < max(older, newer) <= STEADY_FACTOR * min(older, newer)

    def _is_due(self) -> bool:
        waited_s = self._clock() - self._shown_s
        if self._on_terminal:
            return waited_s >= BAR_INTERVAL_S
        return waited_s >= LINE_INTERVAL_S or self._quarter() > self._shown_quarter

    def _quarter(self) -> int:
        return 4 * self._done // self._total if self._total else 4

    def _show(self) -> None:
        self._shown_s, self._shown_quarter = self._clock(), self._quarter()
        if self._bar is not None:
            (task,) = self._bar.task_ids
            self._bar.update(
                task, total=self._total, completed=self._done, status=self._status()
            )
            self._write(self._bar.refresh)
        elif not self._quiet:
            self._write(self._write_line)

    def _write_line(self) -> None:
        self._stream.write(f"{self.text()}\n")
        self._stream.flush()

    def _write(self, show: Callable[[], object]) -> None:
        try:
            show()
        except (OSError, ValueError):
            # Nobody reads it any more; the run continues.
            self._quiet, self._bar = True, None


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


def _new_bar(stream: TextIO) -> rich.progress.Progress:
    """Make a bar that is drawn on request, without its own thread."""
    # Imported here: most runs have no terminal.
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    return Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TextColumn("{task.fields[status]}"),
        console=Console(file=stream, force_terminal=True, highlight=False),
        auto_refresh=False,
        redirect_stdout=False,
    )
