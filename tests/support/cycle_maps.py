"""Bin maps whose cycle times are sums of known parts."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from tests.support.synthetic_maps import synthetic_bin_map
from tests.support.synthetic_parts import bin_with_parts

WAITS_S = 1.5


def with_cycles(**changes: Any) -> Any:
    """A bin map whose cycles are the way in, two stages and 1.5 s of waits."""
    bin_map = bin_with_parts(synthetic_bin_map(**changes))
    cycle = bin_map.cycle
    assert cycle is not None
    assert bin_map.best is not None
    time = bin_map.best.execution_time + cycle.time.sum(axis=-1) + WAITS_S
    whole = np.isfinite(cycle.cycle_time)
    cycle = dataclasses.replace(cycle, cycle_time=np.where(whole, time, np.nan))
    return dataclasses.replace(bin_map, cycle=cycle)
