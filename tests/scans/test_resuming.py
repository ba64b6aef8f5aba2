"""Surveys and roadmaps that an earlier run left are not computed again."""

from __future__ import annotations

import resource
from contextlib import contextmanager

import numpy as np
import pytest

from reachmap.cli.text.info import info_text
from reachmap.errors import IncompleteError
from reachmap.maps import BinMap, Status, read_bin_map, read_workspace_map
from reachmap.runtime.journal import read_store
from reachmap.runtime.signals import Interrupted
from reachmap.runtime.store import store_path
from reachmap.scans import bin_roadmap, ik_survey, workspace_roadmap
from reachmap.scans import bin_scan as planning
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.info import info
from reachmap.tools.workspace_scan import workspace_scan
from tests.scans.test_cycle_toy import TOY

SMALL = ("bin_scan.grid=[3,3]", "bin_scan.repeats=1")


@pytest.fixture
def blocks_of_50(monkeypatch):
    """Surveys in several units, although the cell is small."""
    monkeypatch.setattr(ik_survey, "FRAMES_PER_UNIT", 50)


def never(*arguments, **settings):
    """Stand in for what was done before."""
    raise AssertionError("worked out again")


def interrupted(*arguments, **settings):
    """Stand in for Ctrl-C."""
    raise KeyboardInterrupt


def interrupt_after(function, count):
    """Ctrl-C in the call after this many."""
    calls = []

    def call(*arguments, **settings):
        calls.append(1)
        if len(calls) > count:
            raise KeyboardInterrupt
        return function(*arguments, **settings)

    return call


@pytest.mark.usefixtures("blocks_of_50")
def test_a_workspace_scan_by_roadmap_goes_on(tmp_path, monkeypatch):
    """Interrupted in the survey, then between survey and map: the hash is the same."""
    output = tmp_path / "w.h5"
    workspace_scan("planar-toy", tmp_path / "whole.h5")
    with monkeypatch.context() as change:
        survey = interrupt_after(ik_survey.survey_frames, 5)
        change.setattr(ik_survey, "survey_frames", survey)
        with pytest.raises(Interrupted, match="0 of 1 units and 5 before are"):
            workspace_scan("planar-toy", output)
    with read_store(store_path(output)) as entries:
        assert len(entries.results("survey")) == 5
    with monkeypatch.context() as change:
        change.setattr(workspace_roadmap, "connect_survey", interrupted)
        with pytest.raises(Interrupted):
            workspace_scan("planar-toy", output)
    with monkeypatch.context() as change:
        change.setattr(ik_survey, "survey_frames", never)
        workspace_scan("planar-toy", output)
    whole, resumed = (read_workspace_map(tmp_path / n) for n in ("whole.h5", "w.h5"))
    assert resumed.stamp.content_sha256 == whole.stamp.content_sha256
    assert not store_path(output).exists()


@pytest.mark.usefixtures("blocks_of_50")
def test_a_bin_scan_goes_on_in_its_survey(tmp_path, monkeypatch):
    """Neither survey nor roadmap is computed twice."""
    output = tmp_path / "b.h5"
    bin_scan(None, tmp_path / "whole.h5", cell="planar-toy", overrides=SMALL)
    with monkeypatch.context() as change:
        change.setattr(planning, "plan_grasps", interrupted)
        with pytest.raises(Interrupted):
            bin_scan(None, output, cell="planar-toy", overrides=SMALL)
    with monkeypatch.context() as change:
        change.setattr(ik_survey, "survey_frames", never)
        change.setattr(bin_roadmap, "connect_survey", never)
        bin_scan(None, output, cell="planar-toy", overrides=SMALL)
    whole, resumed = (read_bin_map(tmp_path / name) for name in ("whole.h5", "b.h5"))
    assert resumed.stamp.content_sha256 == whole.stamp.content_sha256


def fail_at(function, count):
    """A defect that shows in the call of that number."""
    calls = []

    def call(*arguments, **settings):
        calls.append(1)
        if len(calls) == count:
            raise ZeroDivisionError("a defect")
        return function(*arguments, **settings)

    return call


@pytest.mark.parametrize("cell", [(), TOY], ids=["no part", "part"])
def test_a_unit_that_was_given_up_is_an_error_in_its_map(tmp_path, monkeypatch, cell):
    """All others are there, as in the journal; the same command completes the map."""
    output, cell = tmp_path / "b.h5", (*cell, "bin_scan.repeats=1")
    bin_scan(None, tmp_path / "whole.h5", cell="planar-toy", overrides=cell)
    whole = read_bin_map(tmp_path / "whole.h5")
    with monkeypatch.context() as change:
        change.setattr(planning, "GRASPS_PER_UNIT", 14)
        change.setattr(planning, "plan_grasps", fail_at(planning.plan_grasps, 2))
        with pytest.raises(IncompleteError, match=r"1 of [26] units"):
            bin_scan(None, output, cell="planar-toy", overrides=cell)
        part, lost = read_bin_map(output), np.zeros(whole.status.shape, bool)
        lost.flat[14:28] = True
        assert (part.status[lost] == Status.ERROR).all()
        np.testing.assert_array_equal(part.status[~lost], whole.status[~lost])
        for place in (output, store_path(output)):
            found = info(place)
            assert isinstance(found.record, BinMap)
            np.testing.assert_array_equal(found.record.status, part.status)
            assert "error" in info_text(found)
        bin_scan(None, output, cell="planar-toy", overrides=cell)
    assert read_bin_map(output).stamp.content_sha256 == whole.stamp.content_sha256


@contextmanager
def room_for(size):
    """Let no file grow beyond a size."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_disk_that_fills_up_among_the_units_costs_none(tmp_path, monkeypatch):
    """The store is named with what is safe, and the same command goes on from there."""
    output, size = tmp_path / "b.h5", ("bin_scan.grid=[8,6]", *SMALL[1:])
    bin_scan(None, tmp_path / "whole.h5", cell="planar-toy", overrides=size)
    with monkeypatch.context() as change:
        change.setattr(
            planning, "plan_grasps", interrupt_after(planning.plan_grasps, 1)
        )
        with pytest.raises(Interrupted, match="1 of 5 units"):
            bin_scan(None, output, cell="planar-toy", overrides=size)
    line = len(store_path(output).read_bytes().rstrip().splitlines()[-1])
    limit = store_path(output).stat().st_size + 5 * line // 2
    said = (
        "File too large; [234] of 5 units and 2 before are safe there; free some space"
    )
    with room_for(limit), pytest.raises(IncompleteError, match=said) as caught:
        bin_scan(None, output, cell="planar-toy", overrides=size)
    assert str(store_path(output)) in str(caught.value)
    assert not output.exists()
    bin_scan(None, output, cell="planar-toy", overrides=size)
    whole, resumed = (read_bin_map(tmp_path / name) for name in ("whole.h5", "b.h5"))
    assert resumed.stamp.content_sha256 == whole.stamp.content_sha256
    assert sorted(tmp_path.iterdir()) == [output, tmp_path / "whole.h5"]
