"""Ctrl-C, SIGTERM and a closed terminal, handled at safe points of a run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from reachmap.errors import ReachmapError

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(KeyboardInterrupt):
    """The run was asked to stop; the text says what is safe and how to resume."""


class StopRequest:
    """Whether a signal has asked the run to stop.

    A signal raises KeyboardInterrupt wherever the program is, but within
    :meth:`deferred` it waits for :meth:`check`. A second one waits for nothing.
    """

    def __init__(self) -> None:
        self.requested = False
        self._deferred = False

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Let a signal wait for :meth:`check`."""
        self._deferred = True
        try:
            yield
        finally:
            self._deferred = False

    def check(self) -> None:
        """Raise KeyboardInterrupt when a signal has come."""
        if self.requested:
            raise KeyboardInterrupt

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Take a signal; for ``signal.signal``."""
        again, self.requested = self.requested, True
        if again or not self._deferred:
            raise KeyboardInterrupt


@contextmanager
def stop_signals() -> Iterator[StopRequest]:
    """Catch the signals that end a run; outside the main thread, catch none."""
    request = StopRequest()
    if threading.current_thread() is not threading.main_thread():
        yield request
        return
    before = {number: signal.getsignal(number) for number in STOP_SIGNALS}
    for number, handler in list(before.items()):
        if handler in (signal.SIG_IGN, None):  # nohup and background jobs mean it
            del before[number]
    try:
        for number in before:
            signal.signal(number, request.handle)
        yield request
    except ReachmapError:
        raise
    except Exception as error:
        # Libraries that call back make an error of their own of the interrupt.
        if request.requested:
            raise KeyboardInterrupt from error
        raise
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
