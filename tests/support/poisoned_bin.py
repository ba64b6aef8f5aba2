"""A bin scan, one unit of which kills whichever worker takes it."""

from __future__ import annotations

import dataclasses
import os
import signal

from reachmap.scans import bin_scan
from tests.support.optional import present

POISONED = 1


def plan_unit(state, grasps):
    """Plan as the real scan does, except for the poisoned unit."""
    if grasps.start == POISONED * bin_scan.GRASPS_PER_UNIT:
        os.kill(os.getpid(), signal.SIGKILL)
    return bin_scan.plan_unit(state, grasps)


def bin_work(*arguments):
    """Work of the real scan with the poisoned unit in it."""
    work = bin_scan.bin_work(*arguments)

    def job(stages):
        return dataclasses.replace(present(work.job(stages)), function=plan_unit)

    return dataclasses.replace(work, job=job)
