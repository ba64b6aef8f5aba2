"""Summaries of cycles against loops over the map."""

from __future__ import annotations

import dataclasses
from collections import Counter
from typing import Any

import numpy as np
import pytest

from reachmap.cli.text.cycle import cycle_lines
from reachmap.maps.cycle.seconds import cycle_parts, throughput_of_bin
from reachmap.maps.cycle.summary import summarise_cycle
from reachmap.maps.parts import StageStatus
from reachmap.plots.bin_map import draw_cycle
from reachmap.plots.causes import draw_causes
from reachmap.plots.curves.timeline import draw_timeline
from reachmap.report.answers import headline_answers
from reachmap.report.folder import RunFolder
from reachmap.report.parts.cycle import cycle_blocks
from tests.support.cycle_maps import WAITS_S, with_cycles
from tests.support.synthetic_maps import synthetic_bin_map


def test_parts_of_a_cycle_add_up():
    """The way in, the stages and the waits, and nothing else."""
    record = with_cycles()
    names, seconds = cycle_parts(record)
    assert names[0] == "to_grasp_s"
    assert names[-1] == "waits_s"
    whole = np.isfinite(record.cycle.cycle_time)
    np.testing.assert_allclose(
        seconds[whole].sum(axis=-1), record.cycle.cycle_time[whole]
    )
    np.testing.assert_allclose(seconds[whole][:, -1], WAITS_S)
    assert np.isnan(seconds[~whole]).all()


def test_counts_and_means_are_those_of_a_loop():
    """Whole cycles, ends by stage, status and pair, and the means of the parts."""
    record = with_cycles()
    cycle, found = record.cycle, summarise_cycle(record)
    assert found is not None
    ends: Counter[tuple[str, str]] = Counter()
    times = []
    for place in np.ndindex(record.status.shape):
        if record.status[place] != 1:
            continue
        states = cycle.status[place].tolist()
        if states == [1] * len(states):
            times.append(cycle.cycle_time[place])
        else:
            k = next(k for k, state in enumerate(states) if state != 1)
            ends[cycle.stages[k], StageStatus(states[k]).name] += 1
    assert found.whole == len(times)
    assert found.seconds == pytest.approx(np.mean(times))
    assert found.most == pytest.approx(max(times))
    assert sum(part.seconds for part in found.parts) == pytest.approx(found.seconds)
    assert sum(part.share for part in found.parts) == pytest.approx(1.0)
    assert sum(end.grasps for end in found.ends) == sum(ends.values())
    assert found.ends[0].status == "ik in collision"


def test_cycles_of_each_drop_off_are_counted():
    """Those that are whole, the first drop-off as well as the others."""
    record = with_cycles()
    rng = np.random.default_rng(6)
    to = rng.integers(0, 3, record.status.shape)
    whole = np.isfinite(record.cycle.cycle_time)
    drop_off = np.where(whole, to, -1)
    cycle = dataclasses.replace(record.cycle, drop_off=drop_off)
    found: Any = summarise_cycle(dataclasses.replace(record, cycle=cycle))
    assert [number for _, number in found.drop_offs] == [
        sum(to[place] == k for place in zip(*np.nonzero(whole), strict=True))
        for k in range(3)
    ]
    assert len({name for name, _ in found.drop_offs}) == 3


def test_the_stage_that_was_tried_is_the_one_that_fails():
    """A drop-off out of reach is the end, not the transfer that nobody tried."""
    record = with_cycles()
    status = record.cycle.status.copy()
    failed = (status != StageStatus.PATH_FOUND).any(axis=-1) & (record.status == 1)
    status[failed] = [StageStatus.NOT_ATTEMPTED, StageStatus.DROP_OFF_UNREACHABLE]
    record = dataclasses.replace(
        record, cycle=dataclasses.replace(record.cycle, status=status)
    )
    found: Any = summarise_cycle(record)
    assert {(end.stage, end.status) for end in found.ends} == {
        (record.cycle.stages[1], "drop off unreachable")
    }


def test_picks_per_hour_of_a_bin_by_hand():
    """Mean over points of the mean over their whole cycles, with an interval."""
    record = with_cycles()
    whole = np.isfinite(record.cycle.cycle_time)
    median = np.median(record.cycle.cycle_time[whole])
    points = []
    for place in np.ndindex(record.status.shape[:3]):
        rows = []
        for k in np.flatnonzero(whole[place]):
            at = (*place, int(k))
            missed = 1 - record.path_found[at].mean()
            checks = record.best.effort_checks[at] * record.effort.seconds_per_check
            rows.append(record.cycle.cycle_time[at] + missed * median + checks)
        if rows:
            points.append(np.mean(rows))
    made: Any = throughput_of_bin(record)
    assert made.picks == len(points)
    assert made.picks_per_hour == pytest.approx(3600 / np.mean(points))
    assert made.low < made.picks_per_hour < made.high


def test_cycles_are_printed_drawn_and_reported():
    """Text, pictures and blocks of the report; nothing for a map without cycles."""
    record = with_cycles()
    found: Any = summarise_cycle(record)
    text = "\n".join(cycle_lines(found))
    assert f"{found.whole} of {found.reached} reached grasps" in text
    assert "picks per hour" in text
    figure = draw_timeline(record, found)
    bars: Any = figure.axes[0].patches
    assert sum(bar.get_width() for bar in bars) == pytest.approx(found.seconds)
    assert len(draw_cycle(record).axes) == 4
    assert cycle_blocks(record) is not None
    ends = draw_causes(record).axes[2]
    assert ends.get_title(loc="left").startswith("reached, but no whole cycle")
    drawn: Any = ends.patches
    lost = sum(end.grasps for end in found.ends[:10])
    share = 100 * lost / record.status.size
    assert sum(bar.get_width() for bar in drawn) == pytest.approx(share)
    tiles = headline_answers(RunFolder(name="run", bin_map=record))
    (tile,) = [tile for tile in tiles if "with the part in hand" in tile.question]
    assert f"{found.seconds:.2f} s" in tile.reply
    plain = synthetic_bin_map()
    assert len(draw_causes(plain).axes) == 2
    assert not any(
        "in hand" in tile.question
        for tile in headline_answers(RunFolder(name="run", bin_map=plain))
    )
    assert summarise_cycle(plain) is None
    assert cycle_lines(None) == []
    assert cycle_blocks(plain) is None


def test_a_map_without_a_whole_cycle_is_printed_drawn_and_reported():
    """Its cycles all end early; nothing is left to take a mean of."""
    record = with_cycles()
    assert record.cycle is not None
    none = np.full_like(record.cycle.cycle_time, np.nan)
    cycle = dataclasses.replace(record.cycle, cycle_time=none)
    record = dataclasses.replace(record, cycle=cycle)
    found = summarise_cycle(record)
    assert "Whole cycles: 0 of " in "\n".join(cycle_lines(found))
    assert len(draw_cycle(record).axes) >= 3
    assert cycle_blocks(record) is not None
    assert headline_answers(RunFolder(name="run", bin_map=record))
