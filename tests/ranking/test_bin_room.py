"""Room for the part where it is gripped: closed form against coal, and in a ranking."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import coal
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reachmap.cell.model.bin_parts import bin_parts
from reachmap.cell.model.bodies import BinSpec
from reachmap.core.collision.shapes import coal_shape
from reachmap.errors import MapFileError
from reachmap.maps import read_bin_map, write_bin_map
from reachmap.maps.parts import StageStatus
from reachmap.ranking import Ranker
from reachmap.ranking.lookup.bin_room import BinRoom
from reachmap.ranking.lookup.costs import status_name
from reachmap.ranking.lookup.matching import Queries
from tests.support.cycle_maps import with_cycles
from tests.support.optional import present

MARGIN, ALLOWANCE = 0.002, 0.003
SIDES = (0.04, 0.03, 0.08)
SIGNS = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, indexing="ij"), -1).reshape(-1, 3)
CORNERS = SIGNS * SIDES + [0.005, 0.0, 0.04]


def queries(points: Any, quaternions: Any, *, free: bool) -> Queries:
    """Grasps along the tool's z."""
    R = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
    n = len(points)
    return Queries(
        points=points,
        axes=R[:, :, 2],
        quaternions=quaternions,
        free=np.full(n, free),
        valid=np.ones(n, bool),
    )


def tilted(rng: np.random.Generator, n: int, most_deg: float) -> np.ndarray:
    """Tools that point down, tilted and turned at random, as quaternions."""
    turn = rng.uniform([0, 0], [2 * np.pi, np.radians(most_deg)], (n, 2))
    spin = rng.uniform(0, 2 * np.pi, n)
    angles = np.column_stack([turn[:, 0], np.pi - turn[:, 1], spin])
    return Rotation.from_euler("ZYZ", angles).as_quat(scalar_first=True)


@pytest.mark.parametrize("top", [None, (0.26, 0.20)])
def test_room_is_what_an_engine_says(top: Any) -> None:
    """A box off its axis among upright and leaning walls, within and across the rim."""
    rng = np.random.default_rng(4)
    spec = BinSpec(inner=(0.22, 0.16, 0.12), inner_top=top, wall=0.05)
    room = BinRoom(
        hulls=(CORNERS,),
        T_bin_base=np.eye(4),
        approach_axis="+z",
        inner=np.array(spec.inner),
        top=np.array(spec.top),
        wall_m=np.inf,
        lowest_m=-ALLOWANCE,
        over_rim_m=MARGIN,
        margin_m=MARGIN,
    )
    n = 600
    points = rng.uniform([-0.10, -0.07, 0.02], [0.10, 0.07, 0.19], (n, 3))
    quaternions = tilted(rng, n, 50.0)
    said = room.is_there(queries(points, quaternions, free=False))
    R = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
    walls = [p for p in bin_parts(spec) if "wall" in p.name]
    judged = 0
    for k in range(n):
        lowest = (CORNERS @ R[k].T + points[k])[:, 2].min()
        nearest = min(distance(R[k], points[k], wall) for wall in walls)
        # At the rim the closed form keeps the margin sideways or upwards, not aslant.
        if abs(nearest - MARGIN) < 0.8 * MARGIN or abs(lowest + ALLOWANCE) < 1e-6:
            continue
        judged += 1
        assert said[k] == (nearest > MARGIN and lowest > -ALLOWANCE), k
    assert judged > 0.8 * n
    assert 0.2 * n < said.sum() < 0.8 * n


def distance(R: Any, p: Any, wall: Any) -> float:
    """Signed distance of the box and a wall by coal."""
    request, result = coal.DistanceRequest(True), coal.DistanceResult()
    coal.distance(
        coal.Box(*SIDES),
        coal.Transform3s(R, R @ np.array([0.005, 0.0, 0.04]) + p),
        coal_shape(wall.shape),
        coal.Transform3s(np.eye(3), np.asarray(wall.centre_m, float)),
        request,
        result,
    )
    return float(result.min_distance)


def test_a_free_roll_finds_the_turn_that_fits() -> None:
    """A plate longer than the bin is wide fits along it, and not across it."""
    plate = SIGNS * [0.02, 0.20, 0.03] + [0, 0, 0.015]
    room = BinRoom(
        hulls=(plate,),
        T_bin_base=np.eye(4),
        approach_axis="+z",
        inner=np.array([0.10, 0.30, 0.10]),
        top=np.array([0.10, 0.30]),
        wall_m=np.inf,
        lowest_m=0.0,
        over_rim_m=MARGIN,
        margin_m=MARGIN,
    )
    point = np.array([[0.0, 0.0, 0.05]])
    for turn_deg, fits in ((0.0, True), (90.0, False)):
        down = Rotation.from_euler("xz", [180, turn_deg], degrees=True)
        tool = down.as_quat(scalar_first=True)[None]
        assert room.is_there(queries(point, tool, free=False))[0] == fits
        assert room.is_there(queries(point, tool, free=True))[0]
        assert not room.is_there(queries(point - [0, 0, 0.03], tool, free=True))[0]


HOUSING, TUBE = (0.08, 0.05, 0.06), {"radius": 0.02, "length": 0.1}
OTHERS = {"capsule": None, "sphere": None, "mesh": None}
TOOL_CELL: dict[str, Any] = {
    "robot": {"tcp": {"parent": "tool0", "xyz": [0, 0, 0.1], "approach_axis": "+z"}},
    "bin": {"inner": [0.22, 0.16, 0.12], "inner_top": None, "mesh": None, "wall": 0.01},
    "collision": {"safety_margin_m": MARGIN},
    "bodies": [
        {
            "name": "housing",
            "attach_to": "tool0",
            "shape": {"box": HOUSING, "cylinder": None, **OTHERS},
            "pose": {"xyz": [0.0, -0.07, 0.03], "rpy_deg": [0, 0, 20]},
            "touch": [],
        },
        {
            "name": "tube",
            "attach_to": "tool0",
            "shape": {"box": None, "cylinder": TUBE, **OTHERS},
            "pose": {"xyz": [0.0, 0.0, 0.05]},
            "touch": ["bin bottom"],
        },
    ],
}


@pytest.mark.parametrize("touches", [True, False])
def test_the_tool_has_no_room_only_where_it_collides(touches: bool) -> None:
    """What is refused, coal finds in a wall or the bottom; where it is far, room is."""
    rng = np.random.default_rng(5)
    cell = json.loads(json.dumps(TOOL_CELL))
    if not touches:
        cell["bodies"][1]["touch"] = []
    room = present(BinRoom.for_tool(json.dumps(cell), np.eye(4)))
    spec = BinSpec(inner=(0.22, 0.16, 0.12), wall=0.01)
    n = 400
    points = rng.uniform([-0.10, -0.07, 0.02], [0.10, 0.07, 0.14], (n, 3))
    quaternions = tilted(rng, n, 40.0)
    said = room.is_there(queries(points, quaternions, free=False))
    R = Rotation.from_quat(quaternions, scalar_first=True).as_matrix()
    housing = coal.Box(*HOUSING), [0.0, -0.07, -0.07], 20.0
    tube = coal.Cylinder(TUBE["radius"], TUBE["length"]), [0.0, 0.0, -0.05], 0.0
    nearest = np.array(
        [
            min(
                gap(shape, R[k] @ turned_deg(turn), R[k] @ at + points[k], part)
                for shape, at, turn in ((housing,) if touches else (housing, tube))
                for part in bin_parts(spec)
            )
            for k in range(n)
        ]
    )
    assert 0.2 * n < said.sum() < 0.8 * n
    # Corners of a sixteen-sided cylinder lie 2 % of its radius inside it.
    assert (nearest[~said] < MARGIN + 1e-6).all()
    assert (nearest[said] > -0.001).mean() > 0.9


def turned_deg(angle: float) -> Any:
    """Rotation about z."""
    return Rotation.from_euler("z", angle, degrees=True).as_matrix()


def gap(shape: Any, R: Any, p: Any, part: Any) -> float:
    """Signed distance of a shape and a part of the bin by coal."""
    request, result = coal.DistanceRequest(True), coal.DistanceResult()
    coal.distance(
        shape,
        coal.Transform3s(R, p),
        coal_shape(part.shape),
        coal.Transform3s(np.eye(3), np.asarray(part.centre_m, float)),
        request,
        result,
    )
    return float(result.min_distance)


def test_a_tool_outside_the_wall_has_room() -> None:
    """A low bin beside which the housing hangs, on the other side of its wall."""
    cell = json.loads(json.dumps(TOOL_CELL))
    cell["bin"]["inner"] = [0.22, 0.16, 0.20]
    cell["bodies"][0]["pose"]["xyz"] = [0.0, -0.14, 0.03]
    room = present(BinRoom.for_tool(json.dumps(cell), np.eye(4)))
    down = Rotation.from_euler("x", 180, degrees=True).as_quat(scalar_first=True)
    asked = [[0.0, y, 0.02] for y in (0.0, -0.03, 0.05)]
    said = room.is_there(queries(np.array(asked), np.tile(down, (3, 1)), free=False))
    # Turned over, the housing hangs towards +y: outside, in the wall, outside.
    assert said.tolist() == [True, False, True]


def test_a_cell_that_does_not_say_where_its_bin_is() -> None:
    """Nothing is known of room; what is broken is said."""
    assert BinRoom.for_tool("{}", np.eye(4)) is None
    with pytest.raises(MapFileError, match="unreadable"):
        BinRoom.for_tool('{"bin": {}}', np.eye(4))


def room_map(width_m: float, *touch: str, depth_m: float = 0.04) -> Any:
    """A map with cycles, and a part so wide that hangs so far below the cup."""
    bin_map = with_cycles(shape=(1, 5, 7, 1, 2))
    cell = json.dumps(
        {
            "bin": {"inner": [0.36, 0.26, 0.15], "inner_top": None, "mesh": None},
            "part": "plate",
            "parts": {"plate": {"touch": touch}},
            "lift": {"contact_allowance_m": ALLOWANCE},
            "collision": {"safety_margin_m": MARGIN},
        }
    )
    return dataclasses.replace(
        bin_map,
        part_corners=SIGNS * [width_m, width_m, depth_m] + [0, 0, depth_m / 2],
        provenance=dataclasses.replace(bin_map.provenance, cell_resolved_json=cell),
    )


def test_a_part_that_would_be_in_the_bottom_is_no_cycle() -> None:
    """At a test grasp with a whole cycle, and 30 mm below it."""
    bin_map = room_map(0.01)
    at = np.argwhere(np.isfinite(bin_map.cycle.cycle_time))[0]
    axis = Rotation.from_quat(
        bin_map.quaternion_wxyz[tuple(at)], scalar_first=True
    ).as_matrix()[:, 2]
    up = bin_map.bin_pose[:3, 2]
    point = bin_map.position[tuple(at[:3])]
    ranking = Ranker(bin_map).rank(
        np.array([point, point - 0.03 * up]), np.array([axis, axis]), cost="cycle"
    )
    assert np.isfinite(ranking.cost).tolist() == [True, False]
    assert status_name(ranking.status[1]) == "part_in_collision"
    paper = Ranker(bin_map).rank(point - 0.03 * up, axis)
    assert np.isfinite(paper.cost[0])


def test_walls_that_may_be_touched_leave_room() -> None:
    """A part too wide for a place beside a wall has none, unless it may touch it."""
    bin_map = room_map(0.08, depth_m=0.02)
    whole = np.isfinite(bin_map.cycle.cycle_time)
    at = np.argwhere(whole & (np.arange(whole.shape[1]) == 0)[:, None, None])[0]
    axis = Rotation.from_quat(
        bin_map.quaternion_wxyz[tuple(at)], scalar_first=True
    ).as_matrix()[:, 2]
    for one, reached in ((bin_map, False), (room_map(0.08, "bin", depth_m=0.02), True)):
        ranking = Ranker(one).rank(one.position[tuple(at[:3])], axis, cost="cycle")
        assert np.isfinite(ranking.cost[0]) == reached


def test_a_grasp_beside_a_wall_is_judged_by_those_that_have_room() -> None:
    """The nearest test grasp has no room for the part; the next one is asked."""
    bin_map = room_map(0.01)
    status = bin_map.cycle.status.copy()
    cycle_time = bin_map.cycle.cycle_time.copy()
    whole = np.isfinite(cycle_time)
    layer, y, x, o = next(
        tuple(at)
        for at in np.argwhere(whole)
        if at[2] > 0 and whole[(*at[:2], at[2] - 1, at[3])]
    )
    status[layer, y, x, o] = (StageStatus.PART_IN_COLLISION, 0)
    cycle_time[layer, y, x, o] = np.nan
    cycle = dataclasses.replace(bin_map.cycle, status=status, cycle_time=cycle_time)
    ranker = Ranker(dataclasses.replace(bin_map, cycle=cycle))
    near = bin_map.position[layer, y, x]
    step = bin_map.position[layer, y, x - 1] - near
    axis = Rotation.from_quat(
        bin_map.quaternion_wxyz[layer, y, x, o], scalar_first=True
    ).as_matrix()[:, 2]
    ranking = ranker.rank(near + 0.2 * step, axis, cost="cycle")
    assert ranking.test_grasp[0].tolist() == [layer, y, x - 1, o]
    assert np.isfinite(ranking.cost[0])
    paper = ranker.rank(near + 0.2 * step, axis)
    assert paper.test_grasp[0].tolist() == [layer, y, x, o]


def test_corners_are_kept_in_files(tmp_path: Any) -> None:
    """As they are; and maps without them read as before."""
    bin_map = room_map(0.01)
    write_bin_map(tmp_path / "bin.h5", bin_map)
    read = read_bin_map(tmp_path / "bin.h5")
    np.testing.assert_array_equal(read.part_corners, bin_map.part_corners)
    write_bin_map(tmp_path / "old.h5", dataclasses.replace(bin_map, part_corners=None))
    assert read_bin_map(tmp_path / "old.h5").part_corners is None
