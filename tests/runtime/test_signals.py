"""A signal ends a run, also where a library stands between it and its handler."""

from __future__ import annotations

import os
import signal
from typing import Any

import pytest
from pydantic import BaseModel, field_serializer

from reachmap.errors import NoRoomError
from reachmap.runtime.signals import stop_signals


class Interrupting(BaseModel):
    """A model whose serialisation is interrupted."""

    value: int = 0

    @field_serializer("value")
    def interrupt(self, value: int) -> Any:
        """Ctrl-C within a call back of pydantic, which makes an error of it."""
        os.kill(os.getpid(), signal.SIGINT)
        return value


def test_an_interrupt_that_a_library_wraps_is_an_interrupt() -> None:
    """And no internal error."""
    with pytest.raises(KeyboardInterrupt), stop_signals():
        Interrupting().model_dump_json()


def test_other_errors_stay_what_they_are() -> None:
    """Without a signal; and those that say what is safe, with one."""
    with pytest.raises(ValueError, match="wrong"), stop_signals():
        raise ValueError("wrong")
    with pytest.raises(NoRoomError):
        _full_when_told_to_stop()


def _full_when_told_to_stop() -> None:
    with stop_signals() as stop, stop.deferred():
        os.kill(os.getpid(), signal.SIGINT)
        raise NoRoomError("full")
