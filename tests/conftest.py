"""What all tests share: how hypothesis draws its examples, and which signals count."""

from __future__ import annotations

import signal
import threading

from hypothesis import settings

# A busy machine takes its time; what is slow is seen in the durations, not in failures.
# The default suite tries the same examples everywhere, so that a change fails for its
# own reasons; `make test-slow` explores others each time.
settings.register_profile("reachmap", deadline=None, derandomize=True)
settings.register_profile("explore", deadline=None)
settings.load_profile("reachmap")

# Under nohup or in the background of a script a process ignores these, and so do those
# that it starts: commands that a test tells to stop would not.
if threading.current_thread() is threading.main_thread():
    for number, usual in (
        (signal.SIGINT, signal.default_int_handler),
        (signal.SIGHUP, signal.SIG_DFL),
    ):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, usual)
