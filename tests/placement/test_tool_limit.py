"""What a dimension would give back, against cells in which it is really changed."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.placement.mapped.sample import open_frames
from reachmap.placement.tool_limit import STEP_M, tool_limit
from tests.support.optional import present
from tests.support.scenes import scene_of

UR5 = "ur5-eye-in-hand"
LISTED = "tool.roll=listed"
DEEP = ("bin.inner=[0.36,0.26,0.12]", "bin_scan.grid=[5,4]", "bin_scan.layers=[0.03]")


def limit_of(*overrides):
    """The limit of a cell, and the share of test grasps its tool can take."""
    scene = scene_of(UR5, LISTED, *DEEP, *overrides, with_bin=False)
    is_open = open_frames(scene.robot, scene.loaded)
    return tool_limit(scene.robot, scene.loaded, is_open), 100 * float(is_open.mean())


def test_a_longer_tube_gives_what_a_cell_with_one_has():
    """Tube, and TCP with it, 20 mm longer in the cell file itself."""
    limit, share = limit_of()
    assert limit.percent == pytest.approx(share)
    cell = scene_of(UR5, LISTED, *DEEP, with_bin=False).loaded.cell
    tube = next(body for body in cell.bodies if body.name == "suction tube")
    index = cell.bodies.index(tube)
    length, z = present(tube.shape.cylinder).length, tube.pose.xyz[2]
    tcp = cell.robot.tcp.xyz
    _, longer = limit_of(
        f"bodies.{index}.shape.cylinder.length={length + STEP_M}",
        f"bodies.{index}.pose.xyz.2={z + STEP_M / 2}",
        f"robot.tcp.xyz.2={tcp[2] + STEP_M}",
    )
    gain = limit.gains["length of suction tube"]
    assert gain == pytest.approx(longer - share, abs=0.02)
    assert gain > 5


def test_a_less_deep_bin_gives_what_a_cell_with_one_has():
    """Grasps 20 mm higher in the same walls."""
    limit, share = limit_of()
    _, higher = limit_of("bin_scan.layers=[0.05]")
    key = next(name for name in limit.gains if "less deep" in name)
    assert limit.gains[key] == pytest.approx(higher - share, abs=0.02)


def test_the_best_dimension_comes_first():
    """Gains fall, and none is more than what is lost."""
    limit, share = limit_of()
    gains = list(limit.gains.values())
    assert gains == sorted(gains, reverse=True)
    assert 0 <= min(gains) <= max(gains) <= 100 - share + 0.01
    assert limit.body in {"camera housing", "gripper body", "suction tube"}


def test_a_tool_that_loses_nothing_has_no_limit():
    """Far above a flat tray every grasp is open."""
    scene = scene_of(
        UR5,
        LISTED,
        "bin.inner=[0.36,0.26,0.01]",
        "bin_scan.layers=[0.4]",
        with_bin=False,
    )
    is_open = np.ones((1, 14, 20, 27), bool)
    limit = tool_limit(scene.robot, scene.loaded, is_open)
    assert (limit.percent, limit.gains) == (100.0, {})
