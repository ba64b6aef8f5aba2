"""A bin scan, one unit of which kills whichever worker takes it."""

from __future__ import annotations

import dataclasses
import os
import signal

from reachmap.scans import bin_scan

POISONED = 1


def plan_unit(state, unit):
    """Plan as the real scan does, except for the poisoned unit."""
    if unit == POISONED:
        os.kill(os.getpid(), signal.SIGKILL)
    return bin_scan.plan_unit(state, unit)


def bin_work(*arguments):
    """Work of the real scan with the poisoned unit in it."""
    return dataclasses.replace(bin_scan.bin_work(*arguments), function=plan_unit)
