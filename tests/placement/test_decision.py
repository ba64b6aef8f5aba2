"""The search with a formula for a score: what it finds, and what it refuses."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from reachmap.cell.loading import read_cell
from reachmap.core.collision.bin_fit import BinFit
from reachmap.core.scene import Scene
from reachmap.errors import SceneError
from reachmap.placement.decision import (
    decide_as_given,
    decide_by_paper,
    paper_pose,
    settle,
)
from reachmap.placement.mapped.imaging import OUT_OF_SIGHT, still_camera
from reachmap.placement.mapped.sample import open_frames
from reachmap.placement.predicted.places import apart_m
from reachmap.placement.predicted.region import Region
from reachmap.placement.problem import PlacementProblem
from reachmap.placement.room import DropOffRoom
from reachmap.placement.search import decide_by_search
from reachmap.placement.steadying import stated_worst, steadied, worst_of
from reachmap.placement.tolerance import Tolerance
from tests.support.closed_form_evaluator import ClosedForm
from tests.support.optional import present
from tests.support.scenes import scene_of
from tests.support.synthetic_maps import synthetic_workspace_map

UR5 = "ur5-eye-in-hand"
SCENE = scene_of(UR5, with_bin=False)
MOVING = Scene.build(SCENE.loaded, with_bin=True, bin_moves=True)
X = np.round(np.arange(0.0, 1.01, 0.1), 9)
Y = np.round(np.arange(-0.8, 0.81, 0.16), 9)


def problem(
    formula,
    *,
    low=(0.0, -0.8, 0.0, 0.0),
    high=(1.0, 0.8, 0.1, np.pi),
    keep_scan=True,
):
    """A problem on the UR5 cell whose poses are scored by a formula."""
    x, y = np.meshgrid(X, Y)
    near = np.clip(1.2 - np.hypot(x - 0.5, y - 0.3), 0.0, 1.0)
    workspace = synthetic_workspace_map(
        np.array([near, near]), x=X, y=Y, z=np.array([0.0, 0.1]), orientations=9
    )
    return PlacementProblem(
        loaded=SCENE.loaded,
        workspace=workspace,
        is_open=open_frames(SCENE.robot, SCENE.loaded),
        region=Region(low=np.array(low), high=np.array(high)),
        scene=SCENE,
        moving=MOVING,
        keep_scan=keep_scan,
        fit=BinFit(SCENE.robot, SCENE.loaded, None),
        evaluator=ClosedForm(formula),
    )


def hill(x, y, z, yaw):
    """A score with one summit, 96 %, that falls off in all directions."""

    def score(pose):
        turned = (pose[3] - yaw + np.pi / 2) % np.pi - np.pi / 2
        away = np.array([pose[0] - x, pose[1] - y, pose[2] - z, 0.2 * turned])
        return float(96.0 - 60.0 * np.linalg.norm(away))

    return score


def test_the_search_climbs_to_the_summit():
    """From the best places of the map the exact search goes to what is really best."""
    asked = problem(hill(0.46, 0.2, 0.05, 0.6))
    decision = decide_by_search(asked, 5)
    rows = decision.table.rows
    best = rows[decision.ranked[0]]
    assert present(best.score).score > 92.0
    tried = [asked.evaluator.formula(pose) for pose in asked.evaluator.asked]
    assert present(best.score).score == pytest.approx(max(tried))
    scores = [present(rows[k].score).score for k in decision.ranked]
    assert scores == sorted(scores, reverse=True)
    assert all(rows[k].exact for k in decision.ranked)


def test_the_runner_up_stands_elsewhere():
    """The runner-up is the best of those half a bin away, not the next step."""
    asked = problem(hill(0.46, 0.2, 0.05, 0.6))
    decision = decide_by_search(asked, 5)
    outcome = settle(asked, decision)
    rows = decision.table.rows
    chosen, second = rows[outcome.chosen], rows[outcome.runner_up]
    assert apart_m(chosen.pose, second.pose) >= asked.different_place_m == 0.18
    for k in decision.ranked:
        if apart_m(rows[k].pose, chosen.pose) >= 0.18:
            assert present(rows[k].score).score <= present(second.score).score


def test_announced_poses_are_never_too_few():
    """Progress never has to be corrected upwards, and ends at what was looked at."""
    asked = problem(hill(0.46, 0.2, 0.05, 0.6))
    settle(asked, decide_by_search(asked, 3))
    evaluator = asked.evaluator
    totals = [before + more for before, more in evaluator.expected]
    assert totals == sorted(totals, reverse=True)
    assert totals[-1] == len(evaluator.asked)


def test_fixed_values_stay_fixed():
    """Neither steps nor turns leave a fixed value or the region."""
    asked = problem(
        hill(0.9, 0.7, 0.3, 2.0), low=(0.3, -0.2, 0.05, 0.5), high=(0.6, 0.3, 0.05, 0.5)
    )
    decide_by_search(asked, 4)
    poses = np.array(asked.evaluator.asked)
    assert (poses[:, 2] == 0.05).all()
    assert np.allclose(poses[:, 3], 0.5)
    inside = [asked.region.outside(pose) == "" for pose in poses]
    assert all(inside)


def test_a_region_in_the_pedestal_is_a_clear_error():
    """Where the bin can stand nowhere, the message says what it meets."""
    low, high = (0.0, -0.1, -0.3, 0.0), (0.2, 0.1, -0.1, np.pi)
    with pytest.raises(SceneError, match=r"nowhere.*the bin collides with pedestal"):
        decide_by_search(problem(hill(0, 0, 0, 0), low=low, high=high), 5)


def test_a_region_without_a_scan_configuration_is_a_clear_error():
    """Where the arm would meet the bin at every pose, the message says so."""
    asked = problem(lambda pose: "bin wall +x | forearm at the scan configuration")
    with pytest.raises(SceneError, match=r"nowhere.*forearm at the scan config"):
        decide_by_search(asked, 5)
    with pytest.raises(SceneError, match=r"nowhere.*forearm at the scan config"):
        decide_by_paper(asked)


def test_the_papers_pose_is_its_point_at_the_cells_own_angle():
    """The centre of the inner bottom is put on the densest point, turned as before."""
    asked = problem(hill(0.46, 0.2, 0.05, 0.6))
    pose = present(paper_pose(asked))
    level = asked.workspace.path_reachability[0]
    assert pose[3] == pytest.approx(np.pi / 2)
    row, column = (
        int(np.argmin(np.abs(axis - value)))
        for axis, value in ((Y, pose[1]), (X, pose[0]))
    )
    assert level[row, column] == 100.0
    decision = decide_by_paper(asked)
    assert decision.table.rows[decision.paper].pose == pose


def test_a_given_pose_is_scored_beside_the_papers():
    """The user's pose is row 0 and chosen, the paper's is there to compare."""
    asked = problem(hill(0.46, 0.2, 0.05, 0.6))
    decision = decide_as_given(asked, (0.5, 0.0, 0.0, 0.0))
    assert decision.ranked == [0]
    assert decision.table.rows[0].pose == (0.5, 0.0, 0.0, 0.0)
    assert decision.table.rows[decision.paper].pose == paper_pose(asked)


def test_a_given_pose_in_the_pedestal_names_the_pair():
    """A pose that cannot be is refused, with the part of the bin and the body."""
    with pytest.raises(SceneError, match=r"--bin-pose: bin .* touches pedestal"):
        decide_as_given(problem(hill(0, 0, 0, 0)), (0.2, 0.2, -0.1, 0.0))


def test_a_given_pose_without_a_start_says_why():
    """A pose with the arm in the way is refused with the reason."""
    asked = problem(lambda pose: "bin wall +x | forearm at the scan configuration")
    with pytest.raises(SceneError, match=r"--bin-pose: bin wall \+x \| forearm"):
        decide_as_given(asked, (0.5, 0.0, 0.0, 0.0))


def test_places_that_cannot_be_imaged_are_passed_over():
    """High places, where the camera cannot get above the bin, are excluded as such."""
    asked = problem(
        lambda pose: 60.0 + 30.0 * pose[2],
        low=(0.2, -0.6, 0.0, 0.0),
        high=(0.8, 0.6, 0.7, 0.0),
        keep_scan=False,
    )
    share = np.full((3, len(Y), len(X)), 0.3)
    share[2] = 0.0
    share[2, 4:7, 4:8] = 1.0
    workspace = synthetic_workspace_map(share, x=X, y=Y, z=np.array([0.0, 0.3, 0.7]))
    asked = dataclasses.replace(asked, workspace=workspace)
    decision = decide_by_search(asked, 2)
    reasons = decision.table.reasons()
    assert "no scan configuration images the bin" in reasons
    mapped = [decision.table.rows[k].pose for k in decision.ranked]
    assert any(asked.can_be_imaged(pose) for pose in mapped)
    assert min(pose[2] for pose in mapped) < 0.3


def test_a_bin_too_high_for_the_camera_is_a_clear_error():
    """Where no place can be imaged, the message says so and what to look at."""
    asked = problem(
        lambda pose: 90.0,
        low=(0.4, 0.0, 0.9, 0.0),
        high=(0.6, 0.1, 0.9, 0.0),
        keep_scan=False,
    )
    with pytest.raises(
        SceneError, match=r"no scan config.*places \(.*\); look elsewhere"
    ):
        decide_by_search(asked, 2)


@pytest.mark.parametrize(("shelf_y_m", "hides"), [(0.0, True), (0.4, False)])
def test_what_hides_the_bin_from_a_standing_camera_is_named(shelf_y_m, hides):
    """A camera looks straight down on the bin, past a shelf or on it."""
    place = f"{{xyz: [0.75, {shelf_y_m}, 0.7]}}"
    loaded = read_cell(
        UR5,
        [
            "camera.parent=world",
            "camera.xyz=[0.75,0,1.3]",
            "camera.rpy_deg=[180,0,0]",
            "camera.range_m=[0.5,2]",
            f"bodies.floor={{attach_to: world, shape: {{box: [0.2, 0.2, 0.02]}}, "
            f"pose: {place}}}",
        ],
    )
    scene = Scene.build(loaded, with_bin=False)
    asked = dataclasses.replace(
        problem(hill(0.5, 0.3, 0.0, 0.0)),
        loaded=loaded,
        scene=scene,
        moving=Scene.build(loaded, with_bin=True, bin_moves=True),
        still_camera=still_camera(scene),
    )
    below, aside = (0.75, 0.0, 0.0, 0.0), (0.75, 0.8, 0.0, 0.0)
    assert asked.can_be_imaged(below) == (not hides)
    assert ("floor hides" in asked.why_unseen(below)) == hides
    # Past the edge of the picture, 28.5 degrees off at the most.
    assert asked.reason_against(aside) == OUT_OF_SIGHT


def test_the_bin_keeps_out_of_the_drop_off(caplog):
    """The summit is where parts are put down; a pose given there is warned of."""
    part = "part={shape: {box: [0.04, 0.04, 0.06]}, pose: {xyz: [0, 0, 0.03]}}"
    down = "pose: {xyz: [0.46, 0.2, 0.1], rpy_deg: [180, 0, 0]}"
    drop_off = f"drop_off={{name: belt, frame: robot_base, {down}}}"
    room = DropOffRoom(scene_of(UR5, part, drop_off, with_bin=False))
    summit = (0.46, 0.2, 0.05, 0.6)
    asked = dataclasses.replace(problem(hill(*summit)), drop_offs=room)
    decision = decide_by_search(asked, 5)
    best = decision.table.rows[decision.ranked[0]].pose
    assert not room.taken(asked.T_base_bin(best))
    assert "leaves no room at the drop-off belt" in asked.reason_against(summit)
    given = decide_as_given(asked, summit)
    assert "--bin-pose: the bin leaves no room at the drop-off belt" in caplog.text
    tolerance = Tolerance(shift_m=0.03, turn_rad=0.05)
    asked = dataclasses.replace(asked, tolerance=tolerance)
    assert worst_of(asked, given.table.rows[0]).score == 0.0


def test_the_pose_is_nudged_from_what_a_neighbour_loses():
    """A plateau ends 25 mm off along a diagonal, for a bin turned one way alone."""
    tolerance = Tolerance(shift_m=0.03, turn_rad=0.05)

    def plateau(pose):
        # What the quick look at few directions does not see.
        return 90.0 - (pose[0] + pose[1] > 1.035 and pose[3] > 0.01)

    asked = dataclasses.replace(problem(plateau), tolerance=tolerance)
    (edge,) = asked.exact([(0.6, 0.4, 0.0, 0.0)])
    assert stated_worst(asked, edge) == 89.0
    (best, *_) = steadied(asked, [edge])
    assert best.worst == 90.0
    assert np.hypot(best.pose[0] - 0.6, best.pose[1] - 0.4) < 0.05
    assert best.pose[2:] == (0.0, 0.0)


def test_a_bin_may_not_get_into_the_drop_off_when_it_is_off():
    """Neighbours and margins end where the part is put down, as the search does."""
    part = "part={shape: {box: [0.04, 0.04, 0.06]}, pose: {xyz: [0, 0, 0.03]}}"
    down = "pose: {xyz: [0.5, 0.5, 0.1], rpy_deg: [180, 0, 0]}"
    drop_off = f"drop_off={{name: belt, frame: robot_base, {down}}}"
    room = DropOffRoom(scene_of(UR5, part, drop_off, with_bin=False))
    tolerance = Tolerance(shift_m=0.03, turn_rad=0.05)
    asked = dataclasses.replace(
        problem(lambda pose: 90.0), drop_offs=room, tolerance=tolerance
    )
    y = next(
        y
        for y in np.arange(0.45, 0.0, -0.01).round(2).tolist()
        if not asked.reason_against((0.5, y, 0.0, 0.0))
    )
    beside, away = (asked.exact([(0.5, at, 0.0, 0.0)])[0] for at in (y, y - 0.1))
    assert worst_of(asked, beside).score == 0.0
    assert worst_of(asked, away).score == 90.0
    decision = decide_as_given(asked, away.pose)
    margin = settle(asked, decision).margin
    assert margin["+y"] == 0.1
    assert margin["-y"] == 0.15
