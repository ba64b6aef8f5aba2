from __future__ import annotations

import io
import re

import pytest

from reachmap.runtime.progress import Progress, clock_text


class Clock:
    """Seconds that pass when told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        """Tell the time."""
        return self.now


@pytest.fixture
def clock():
    """A clock at an arbitrary time."""
    return Clock()


def reporter(clock, **settings):
    """A progress report into a string."""
    stream = io.StringIO()
    return Progress("bin-scan", stream=stream, clock=clock, **settings), stream


def test_a_line_tells_share_success_rate_and_time_left(clock):
    """The line has the parts of the documentation's example, from plain arithmetic."""
    progress, _ = reporter(clock)
    progress.begin(7560)
    for _ in range(2):
        clock.now += 30
        progress.add(300, 279)
    assert progress.text() == (
        "bin-scan 600/7560 (7%) ok 93.0% 10/s elapsed 1:00 ETA 11:36"
    )


def test_resumed_frames_count_as_done_but_not_for_the_rate(clock):
    """Frames of an earlier run must not promise a speed that nobody sees."""
    progress, _ = reporter(clock)
    progress.begin(1000, done=800, ok=400)
    for _ in range(2):
        clock.now += 5
        progress.add(25, 25)
    assert progress.text() == (
        "bin-scan 850/1000 (85%) ok 52.9% 5/s elapsed 0:10 ETA 0:30"
    )


def test_the_rate_is_that_of_the_last_minute(clock):
    """After a slow start the time left follows the speed of now."""
    progress, _ = reporter(clock)
    progress.begin(10_000)
    for _ in range(100):
        clock.now += 10
        progress.add(1, 1)
    for _ in range(120):
        clock.now += 1
        progress.add(20, 20)
    assert " 20/s " in progress.text()
    assert progress.text().endswith("ETA 6:15")


def test_lines_come_at_quarters_and_at_most_every_half_minute(clock):
    """A log file gets a handful of lines, however many units there are."""
    progress, stream = reporter(clock)
    progress.begin(1000)
    for _ in range(1000):
        clock.now += 0.1
        progress.add(1, 1)
    progress.end()
    shares = [line.split("(")[1].split("%")[0] for line in lines(stream)]
    assert shares == ["0", "25", "50", "75", "100"]


def test_a_slow_run_reports_every_half_minute(clock):
    """Between quarters there is a sign of life each 30 s, also without results."""
    progress, stream = reporter(clock)
    progress.begin(1000)
    for _ in range(960):
        clock.now += 0.125
        progress.tick()
    assert len(lines(stream)) == 1 + 4


def test_a_terminal_gets_one_line_that_is_rewritten(clock):
    """On a terminal a bar is redrawn in place, at most ten times a second."""
    progress, stream = reporter(clock, terminal=True)
    progress.begin(1000)
    for _ in range(1000):
        clock.now += 0.01
        progress.add(1, 1)
    progress.end()
    text = stream.getvalue()
    assert text.count("\n") == 1
    assert 50 < text.count("\r") <= 1 + 100 + 2
    assert "1000/1000 (100%)" in text
    assert text.count("\x1b[?25l") == text.count("\x1b[?25h") == 1


def test_a_bar_is_no_wider_than_the_terminal(clock, monkeypatch):
    """A line that wraps would fill the screen."""
    monkeypatch.setenv("COLUMNS", "40")
    progress, stream = reporter(clock, terminal=True)
    progress.begin(10)
    progress.end()
    drawn = re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", stream.getvalue())
    parts = re.split(r"[\r\n]+", drawn)
    assert any("bin-scan" in part for part in parts)
    assert all(len(part) <= 40 for part in parts)


@pytest.mark.parametrize(
    ("rates", "even", "said"),
    [
        ((10, 10), True, True),
        ((10, 15), True, True),
        ((10, 30), True, False),  # speeding up: the last minute says little
        ((30, 10), True, False),
        ((10, 0), True, False),  # nothing has been done for half of the time
        ((10, 10), False, False),  # the rest is known to take longer
    ],
)
def test_time_left_is_said_where_it_means_something(clock, rates, even, said):
    """While both halves of what was watched agree, and frames are alike."""
    progress, _ = reporter(clock)
    progress.begin(10_000, even=even)
    for rate in rates:
        for _ in range(20):
            clock.now += 1
            progress.add(rate, rate)
    assert (" ETA " in progress.text()) is said


def test_no_time_left_is_said_at_once(clock):
    """The first seconds say nothing about the rest."""
    progress, _ = reporter(clock)
    progress.begin(10_000)
    for _ in range(40):
        clock.now += 0.1
        progress.add(10, 10)
    assert " ETA " not in progress.text()


def test_quiet_says_nothing(clock):
    """With no progress wanted the stream stays empty."""
    progress, stream = reporter(clock, quiet=True)
    progress.begin(2)
    progress.add(2, 2)
    progress.end()
    assert stream.getvalue() == ""


def test_a_reader_that_goes_away_does_not_end_the_run(clock):
    """A closed stderr silences the report."""
    progress, stream = reporter(clock)
    progress.begin(2)
    stream.close()
    progress.add(2, 2)
    progress.end()


@pytest.mark.parametrize("total", [0, 1])
def test_degenerate_totals(clock, total):
    """Nothing to do, or one frame, divides nothing by zero."""
    progress, stream = reporter(clock)
    progress.begin(total, done=total)
    progress.end()
    assert "(100%)" in stream.getvalue()


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0, "0:00"), (59.6, "1:00"), (152, "2:32"), (3600, "1:00:00"), (1e6, "277:46:40")],
)
def test_times_read_like_a_clock(seconds, text):
    """Minutes and seconds, with hours when there are any."""
    assert clock_text(seconds) == text


def lines(stream):
    """Whole lines written so far."""
    return stream.getvalue().splitlines()
