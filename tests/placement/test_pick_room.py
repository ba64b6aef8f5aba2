"""Whether bins leave room for the grasps in those beside them."""

from __future__ import annotations

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.core.scene import Scene
from reachmap.geometry import yaw_transform
from reachmap.placement.room import PickRoom

# The tool ends 0.275 m before the flange, on which the housing and the wrist sit.
TOOL_M, BEHIND_M = 0.275, 0.06
DEPTH_M, WALL_M, APPROACH_M, LAYER_M = 0.1, 0.005, 0.05, 0.03


@pytest.fixture(scope="module")
def two_bins(tmp_path_factory):
    """A function to the UR5 cell with a second bin, 0.3 x 0.2 m, and overrides."""
    text = read_cell("ur5-eye-in-hand").text
    head, rest = text.split("\nbin:\n")
    rest = rest[rest.index("\nscan_configuration:") :]
    spec = f"{{inner: [0.3, 0.2, {DEPTH_M}], wall: {WALL_M}, pose: {{xyz: [%s]}}}}"
    bins = f"bins:\n  new: {spec % '0.5, -0.2, 0.0'}\n  other: {spec % '0.5, 0.5, 0.0'}"
    path = tmp_path_factory.mktemp("cells") / "two.yaml"
    path.write_text(f"{head}\n{bins}{rest}")
    down = "bin_scan.orientations={family: cone, tilts_deg: [0, 20], azimuths: [1, 4]}"

    def room(*overrides: str) -> PickRoom:
        layers = f"bin_scan.layers=[{LAYER_M}]"
        approach = f"bin_scan.approach_distance_m={APPROACH_M}"
        loaded = read_cell(str(path), [down, layers, approach, *overrides])
        return PickRoom(Scene.build(loaded, with_bin=False))

    return room


def test_a_bin_above_the_other_is_in_the_way_of_the_tool(two_bins):
    """As far up as the tool reaches from the other's grasps, and no further."""
    room = two_bins()
    low_m = LAYER_M + APPROACH_M + TOOL_M
    for x, y in ((0.5, 0.5), (0.7, 0.5), (0.5, 0.4)):
        for z in (DEPTH_M + 0.01, low_m):
            assert room.taken(yaw_transform(x, y, z, 0.3)) == "other"
        assert room.taken(yaw_transform(x, y, low_m + BEHIND_M, 0.3)) == ""


def test_a_bin_beside_the_other_is_in_nobodys_way(two_bins):
    """Wall to wall, at any height; a little over the other's inside it is."""
    room = two_bins()
    apart_m = 0.2 + 2 * WALL_M
    for z in np.linspace(-0.3, 0.4, 8):
        assert room.taken(yaw_transform(0.5, 0.5 - apart_m, z, 0.0)) == ""
    over_m = apart_m - 2 * WALL_M
    assert room.taken(yaw_transform(0.5, 0.5 - over_m, 0.15, 0.0)) == "other"
    assert room.taken(yaw_transform(0.5, 0.5, -0.2, 0.0)) == ""


def test_room_is_needed_where_the_tool_comes_from(two_bins):
    """Grasps that all lean need it along their mean, which is where they come from."""
    lean_deg = 50.0
    family = f"{{family: list, reference: bin, rpy_deg: [[180, {lean_deg}, 0]]}}"
    room = two_bins(f"bin_scan.orientations={family}")
    # This tool points along -x and down, so it comes from +x and above.
    assert room.taken(yaw_transform(0.9, 0.5, DEPTH_M + 0.15, 0.0)) == "other"
    assert room.taken(yaw_transform(0.1, 0.5, DEPTH_M + 0.15, 0.0)) == ""


def test_bins_that_may_touch_need_room_all_the_same(two_bins):
    """A list of what may touch is about walls."""
    room = two_bins("bins.new.touch=[other]", "bins.other.touch=[new]")
    assert room.taken(yaw_transform(0.5, 0.5, 0.15, 0.0)) == "other"
