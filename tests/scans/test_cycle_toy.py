"""The pick cycle on the planar toy, against closed forms.

The arm is hung on a wall, so that the world's vertical lies in its plane, and its tool
points down into a narrow bin that no link can touch; only the part can.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reachmap.cell.loading import cell_from_json, read_cell
from reachmap.core.planning.lift import Lifts
from reachmap.errors import SceneError
from reachmap.geometry import rotation_from_quaternion_wxyz, transform_from_parts
from reachmap.maps import Status, read_bin_map
from reachmap.maps.cycle.summary import summarise_cycle
from reachmap.maps.parts import StageStatus
from reachmap.runtime.options import RunOptions
from reachmap.scans.cycle.from_scratch import FreshCycles
from reachmap.scans.cycle.scenes import STAGES, CycleScenes
from reachmap.tools.bin_scan import bin_scan, summary_of_bin
from reachmap.tools.check import check
from tests.support.cycle_replay import faults_of_cycle, paths_by_stage

V, A = 2.0, 4.0
DEPTH, LENGTH, HALF, MARGIN = 0.10, 0.03, 0.01, 0.002
PLACE_DEG = {"joint_1": 150.0, "joint_2": -40.0, "joint_3": -100.0}
TOY = (
    "robot.base_pose={rpy_deg: [90, 0, 0]}",
    "robot.tcp.xyz=[0.1, 0, 0.1]",
    "bodies.post.pose.xyz=[0, 0, -3]",
    "bin={frame: world, inner: [0.2, 0.05, 0.1], wall: 0.005, "
    "pose: {xyz: [0.35, -0.16, 0.05]}}",
    "bin_scan={grid: [20, 1], layers: [0.04], repeats: 1, "
    "orientations: {family: list, reference: robot_base, rpy_deg: [[0, 0, -90]]}}",
    "part={shape: {box: [0.03, 0.02, 0.02]}, pose: {xyz: [0.015, 0, 0]}}",
    f"drop_off={{q_deg: {PLACE_DEG}, approach_distance_m: 0}}".replace("'", ""),
)


def scan(folder, *overrides, **options):
    """Scan the toy and read its map."""
    path = folder / "toy.h5"
    bin_scan(
        None,
        path,
        cell="planar-toy",
        overrides=(*TOY, *overrides),
        run=RunOptions(overwrite=True, quiet=True, **options),
    )
    return read_bin_map(path)


def loaded_from(record):
    """The cell of a map."""
    given = record.provenance
    return cell_from_json(given.cell_resolved_json, urdf=given.urdf, srdf=given.srdf)


@pytest.fixture(scope="module")
def toy(tmp_path_factory):
    """The toy's map as it stands."""
    return scan(tmp_path_factory.mktemp("toy"))


def tcp(q: np.ndarray) -> np.ndarray:
    """TCP in the plane, by hand: (along x, up)."""
    a, b, c = np.cumsum(q)
    return np.array(
        [
            0.4 * np.cos(a) + 0.2 * np.cos(b) + 0.1 * np.cos(c),
            0.4 * np.sin(a) + 0.2 * np.sin(b) + 0.1 * np.sin(c),
        ]
    )


def trapezoid_s(q_from: np.ndarray, q_to: np.ndarray) -> float:
    """Shortest time of a straight motion, by hand."""
    way = float(np.abs(q_to - q_from).max())
    return 2 * np.sqrt(way / A) if way <= V * V / A else way / V + V / A


def test_walls_take_the_outermost_grasps(toy):
    """A part 20 mm wide keeps 2 mm from walls 200 mm apart: |x| up to 88 mm."""
    found = toy.status == Status.PATH_FOUND
    fits = np.abs(toy.x) + HALF + MARGIN < 0.1
    lift = toy.cycle.status[..., 0]
    assert 0 < fits.sum() < len(fits)
    assert found[0, 0, ~fits].all()
    assert (lift[0, 0, ~fits] == StageStatus.PART_IN_COLLISION).all()
    assert (lift[0, 0, fits] == StageStatus.PATH_FOUND).all()
    pairs = {toy.body_pairs[k] for k in toy.cycle.blocking_pair[0, 0, ~fits, 0, 0]}
    assert pairs == {"part | bin wall +x", "part | bin wall -x"}
    assert toy.cycle.reachability.ravel().tolist() == [100.0 * f for f in fits]


def test_lifts_are_as_high_as_the_rim_asks(toy):
    """The part's lower end rises straight from 10 mm to 10 mm above the rim."""
    whole = np.argwhere(toy.cycle.drop_off >= 0)
    for grasp in whole:
        lift = paths_by_stage(toy, grasp)[1]
        points = np.array([tcp(q) for q in lift])
        rise = DEPTH + 0.01 - (0.04 - LENGTH)
        np.testing.assert_allclose(points[-1] - points[0], [0, rise], atol=1e-6)
        np.testing.assert_allclose(points[:, 0], points[0, 0], atol=1e-4)


def test_every_time_is_the_closed_form(toy):
    """The transfer and the return are straight, and the cycle is the sum of all."""
    place = np.radians([*PLACE_DEG.values()])
    scan_q = toy.scan_configuration
    for grasp in np.argwhere(toy.cycle.drop_off >= 0):
        stages = paths_by_stage(toy, grasp)
        times = toy.cycle.time[tuple(grasp)]
        np.testing.assert_allclose(stages[2], [stages[1][-1], place], atol=1e-9)
        assert times[1] == pytest.approx(trapezoid_s(stages[1][-1], place))
        assert times[4] == pytest.approx(trapezoid_s(place, scan_q))
        assert times[2] == times[3] == 0
        total = toy.best.execution_time[tuple(grasp)] + times.sum()
        assert toy.cycle.cycle_time[tuple(grasp)] == pytest.approx(total)
        lengths = [np.linalg.norm(np.diff(stages[k], axis=0), axis=1).sum()
                   for k in range(1, 6)]  # fmt: skip
        np.testing.assert_allclose(toy.cycle.length[tuple(grasp)], lengths)


def test_waits_are_added_and_pictures_overlap(tmp_path, toy):
    """A picture while the part is put down costs what the way back leaves of it."""
    waits = "cycle={image_s: 2.5, grasp_s: 0.3, release_s: 0.2, io_s: 0.1}"
    plain = scan(tmp_path, waits)
    np.testing.assert_allclose(
        plain.cycle.cycle_time, toy.cycle.cycle_time + 3.1, atol=1e-9
    )
    hidden = scan(tmp_path, waits, "cycle.capture_overlaps_place=true")
    back_s = toy.cycle.time[..., 2:].sum(axis=-1) + 0.2
    np.testing.assert_allclose(
        hidden.cycle.cycle_time,
        toy.cycle.cycle_time + 0.6 + np.maximum(2.5 - back_s, 0),
        atol=1e-9,
    )


def test_the_arm_returns_by_way_of_home(tmp_path):
    """The way back passes through the configuration that the cell names."""
    home = {"joint_1": 100.0, "joint_2": 20.0, "joint_3": 10.0}
    record = scan(tmp_path, f"cycle.return_to={{q_deg: {home}}}".replace("'", ""))
    q_home = np.radians([*home.values()])
    for grasp in np.argwhere(record.cycle.drop_off >= 0)[:3]:
        back = paths_by_stage(record, grasp)[5]
        assert np.abs(back - q_home).max(axis=1).min() < 1e-9
        time = trapezoid_s(back[0], q_home) + trapezoid_s(q_home, back[-1])
        assert record.cycle.time[(*grasp, 4)] == pytest.approx(time)
    scenes = CycleScenes.of(loaded_from(record))
    assert scenes is not None
    at = tuple(grasp)
    R = rotation_from_quaternion_wxyz(record.quaternion_wxyz[at])
    T = transform_from_parts(R, record.position[at[:3]])
    fresh = FreshCycles(scenes).plan(T[None], seed=1)
    # On the branch that is nearest, and by way of home, too.
    assert fresh.seconds >= record.cycle.cycle_time[at] - 1e-6


@pytest.mark.slow
def test_nothing_collides_in_an_independent_replay(toy):
    """The outermost stored cycles, at a third of the verification distance."""
    loaded = loaded_from(toy)
    for grasp in np.argwhere(toy.cycle.drop_off >= 0)[[0, -1]]:
        assert faults_of_cycle(loaded, toy, grasp) == []


def lifted(*overrides):
    """What becomes of a lift from the middle of the bin."""
    loaded = read_cell("planar-toy", (*TOY, *overrides))
    scenes = CycleScenes.of(loaded)
    assert scenes is not None
    T = np.linalg.inv(loaded.cell.robot.base_pose.matrix())
    height = loaded.cell.bin_scan.layers[0]
    target = T @ np.array([0.35, -0.16, 0.05 + height, 1.0])
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1.0]])
    pose[:3, 3] = target[:3]
    Q = scenes.empty.kinematics.solve(pose)
    return Lifts(scenes.lifted, scenes.carried, scenes.part).of(Q[0])


@pytest.mark.parametrize("allowance_mm", [0.0, 1.0, 2.0, 3.5])
def test_the_part_may_start_in_the_bottom_by_its_allowance(allowance_mm):
    """Allowed to a hundredth of a millimetre, and refused by as much more."""
    allow = f"lift.contact_allowance_m={allowance_mm / 1e3}"
    for more_mm, status in ((-0.01, StageStatus.PATH_FOUND),
                            (0.01, StageStatus.PART_IN_COLLISION)):  # fmt: skip
        height = LENGTH - (allowance_mm + more_mm) / 1e3
        found = lifted(
            allow, f"bin_scan.layers=[{height}]", "lift.contact_distance_m=0.01"
        )
        assert found.status == status
        assert found.blocking_pair == (
            "part | bin bottom" if status != StageStatus.PATH_FOUND else ""
        )


@pytest.mark.parametrize(("distance_mm", "leaves"), [(3.9, False), (4.1, True)])
def test_contact_ends_in_the_first_millimetres(distance_mm, leaves):
    """2 mm inside, the part is 2 mm clear of the bottom after 4 mm of its lift."""
    found = lifted(
        "lift.contact_allowance_m=0.002",
        f"bin_scan.layers=[{LENGTH - 0.002}]",
        f"lift.contact_distance_m={distance_mm / 1e3}",
    )
    assert (found.status == StageStatus.PATH_FOUND) == leaves
    assert leaves or found.status == StageStatus.LIFT_BLOCKED


def test_neighbours_are_passed_upwards_only():
    """A part among others leaves straight up, not along a tool that leans."""
    heap = ("bin.heap=0.035", "bin_scan.layers=[0.04]")
    assert lifted(*heap).status == StageStatus.PATH_FOUND
    assert lifted(*heap, "lift.direction=tool").status == StageStatus.PATH_FOUND
    lean = ("bin.pose.rpy_deg=[0, 20, 0]", "lift.contact_allowance_m=0.001")
    found = lifted(*heap, *lean)
    assert (found.status, found.blocking_pair) == (
        StageStatus.LIFT_BLOCKED,
        "part | bin heap",
    )


def test_lifts_of_a_given_length(tmp_path):
    """Metres in the cell are metres of the TCP."""
    record = scan(tmp_path, "lift.height=0.123", "bin_scan.grid=[3, 1]")
    lift = paths_by_stage(record, np.argwhere(record.cycle.drop_off >= 0)[0])[1]
    assert tcp(lift[-1])[1] - tcp(lift[0])[1] == pytest.approx(0.123, abs=1e-6)


def roof(room_mm):
    """A roof over the bin's middle that only the part can touch, as an override.

    It leaves the part so much room above the rim, the safety margin counted.
    """
    under_m = 0.05 + DEPTH + LENGTH + MARGIN + room_mm / 1e3
    return (
        'bodies=[{"name":"roof","attach_to":"world","shape":{"box":[0.05,0.02,0.002]},'
        f'"pose":{{"xyz":[0.35,-0.16,{under_m + 0.001}]}}}}]'
    )


@pytest.mark.parametrize(
    ("room_mm", "above_rim_mm"),
    [(10.1, 10.0), (9.9, 7.5), (7.4, 5.0), (2.6, 2.5), (2.4, None)],
)
def test_lifts_end_lower_where_something_is_above(room_mm, above_rim_mm):
    """At the highest of the heights that leave the part its margin, or nowhere."""
    found = lifted(roof(room_mm))
    if above_rim_mm is None:
        assert (found.status, found.blocking_pair) == (
            StageStatus.LIFT_BLOCKED,
            "roof | part",
        )
        return
    assert found.status == StageStatus.PATH_FOUND
    assert found.above_rim_m == pytest.approx(above_rim_mm / 1e3)
    low, high = (tcp(q)[1] for q in (found.way[0], found.way[-1]))
    rise = DEPTH + above_rim_mm / 1e3 - (0.04 - LENGTH)
    assert high - low == pytest.approx(rise, abs=1e-6)


def test_lower_lifts_are_kept_and_reported(tmp_path, toy):
    """The map holds how far above the rim each ends; `info` counts the lower ones."""
    record = scan(tmp_path, roof(6.0), "drop_off=null", "bin_scan.grid=[3, 1]")
    above_m = record.lift_above_rim.ravel()
    np.testing.assert_allclose(above_m[1], 0.005)
    told: Any = summarise_cycle(record)
    assert told.lower_lifts == (
        f"1 of {told.whole} lifts end lower than 10 mm above the rim, the lowest at "
        "5.0 mm"
    )
    whole = np.isfinite(toy.cycle.cycle_time)
    np.testing.assert_allclose(toy.lift_above_rim[whole], 0.01)
    assert np.isnan(toy.lift_above_rim[~whole]).all()
    told = summarise_cycle(toy)
    assert told.lower_lifts == ""


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (("bin_scan.layers=[0.02]",), "10 mm or more inside the bin bottom at all 20"),
        (("part.shape={box: [0.03, 0.02, 0.06]}",), "starts inside a wall at all 20"),
        (("part={shape: {box: [0.03, 0.3, 0.3]}, pose: {xyz: [0.015, 0, 0]}}",
          "tool.roll=free"),
         "wall at all 20 test grasps, however the tool is turned"),
        (("cycle.return_to={q_deg: {joint_1: 0, joint_2: 0, joint_3: 0}}",
          "bodies.post.pose.xyz=[0.2, 0, 0]"),
         "cycle.return_to: link_1 touches post"),
    ],
)  # fmt: skip
def test_parts_that_cannot_be_there_are_refused(tmp_path, overrides, message):
    """In a sentence, before any work, with nothing written."""
    with pytest.raises(SceneError, match=message):
        scan(tmp_path, *overrides)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("drop_off={pose: {xyz: [5, 0, 0]}}", "nothing can be put down at 'drop-off'"),
        ("bin_scan.layers=[0.02]", "10 mm or more inside the bin bottom"),
    ],
)
def test_check_says_so_before_any_scan(override, message):
    """And lists the part among the bodies."""
    answer = check("planar-toy", (*TOY, override))
    assert any(message in warning for warning in answer.warnings)
    assert "part" in [row.name for row in answer.bodies]


def test_a_place_out_of_reach_is_a_result(tmp_path, caplog):
    """Grasps and lifts stay; the stage that fails has the status; said beforehand."""
    far = "drop_off={pose: {xyz: [5, 0, 0]}}"
    record = scan(tmp_path, far, "bin_scan.grid=[3, 1]")
    assert "nothing can be put down at 'drop-off' (out of reach" in caplog.text
    status = record.cycle.status[record.status == Status.PATH_FOUND]
    assert (status[:, 0] == StageStatus.PATH_FOUND).all()
    assert (status[:, STAGES.index("place")] == StageStatus.DROP_OFF_UNREACHABLE).all()
    assert np.nanmax(record.cycle.reachability) == 0
    assert np.nanmax(record.path_reachability) == 100


def test_the_lift_alone_where_the_part_goes_nowhere(tmp_path):
    """Without a drop-off the map has the lift as its only stage."""
    record = scan(tmp_path, "drop_off=null", "bin_scan.grid=[3, 1]")
    assert record.cycle.stages == ("lift",)
    assert np.nanmax(record.cycle.reachability) == 100


def test_the_nearer_of_two_places_is_taken(tmp_path):
    """Each grasp goes where its cycle is shortest; both tried alone are no quicker."""
    far = {"joint_1": -90.0, "joint_2": 0.0, "joint_3": 0.0}
    near = PLACE_DEG
    both = [
        f"{{name: {name}, q_deg: {q}, approach_distance_m: 0}}".replace("'", "")
        for name, q in (("far", far), ("near", near))
    ]
    grid = "bin_scan.grid=[3, 1]"
    record = scan(tmp_path, f"drop_off=[{', '.join(both)}]", grid)
    single = [scan(tmp_path, f"drop_off={place}", grid) for place in both]
    whole = record.cycle.drop_off >= 0
    assert (record.cycle.drop_off[whole] == 1).all()
    np.testing.assert_allclose(
        record.cycle.cycle_time[whole],
        np.minimum(*(one.cycle.cycle_time for one in single))[whole],
    )
    told: Any = summarise_cycle(record)
    assert told.put_down == f"far 0, near {whole.sum()}"
    said = summary_of_bin(record)
    assert said["whole_cycles_percent"] == pytest.approx(100 * whole.mean(), abs=0.01)
    mean_s = np.nanmean(record.cycle.cycle_time)
    assert said["cycle_time_s"] == pytest.approx(mean_s, abs=0.01)


def test_the_map_does_not_depend_on_the_workers(tmp_path, toy):
    """Two workers make the same contents."""
    again = scan(tmp_path, workers=2)
    assert again.stamp.content_sha256 == toy.stamp.content_sha256
