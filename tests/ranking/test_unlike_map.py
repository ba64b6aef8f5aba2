"""What a ranking does not know: unlike grasps, invalid rows, lists that do not fit."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from click.testing import CliRunner, Result
from scipy.spatial.transform import Rotation

from reachmap.cli import group
from reachmap.errors import SettingsError
from reachmap.ranking import Ranker
from reachmap.ranking.lookup.costs import INVALID, OUTSIDE_MAP, UNLIKE_MAP
from tests.support.ranking_maps import make_bin_map

BIN_MAP = make_bin_map(seed=7, reachable=0.6)
RANKER = Ranker(BIN_MAP)
POINT = BIN_MAP.position[0, 2, 3]


def axes_of_map() -> np.ndarray:
    """Approach directions at a test point, by SciPy."""
    wxyz = BIN_MAP.quaternion_wxyz[0, 2, 3]
    R = Rotation.from_quat(np.roll(wxyz, -1, axis=1)).as_matrix()
    sign = 1.0 if BIN_MAP.approach_axis[0] == "+" else -1.0
    return np.asarray(sign * R[:, :, "xyz".index(BIN_MAP.approach_axis[1])])


def test_directions_far_from_all_of_the_map_are_unlike_it() -> None:
    """By brute force over the map's directions: 1.5 times the greatest gap."""
    known = axes_of_map()
    between = np.arccos(np.clip(known @ known.T, -1, 1))
    gap = np.where(between > 1e-6, between, np.inf).min(axis=1).max()
    v = np.random.default_rng(0).normal(size=(400, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    nearest = np.arccos(np.clip(v @ known.T, -1, 1)).min(axis=1)
    ranking = RANKER.rank(np.tile(POINT, (400, 1)), v)
    np.testing.assert_array_equal(ranking.status == UNLIKE_MAP, nearest > 1.5 * gap)
    assert np.isinf(ranking.cost[ranking.status == UNLIKE_MAP]).all()
    assert 0 < (ranking.status == UNLIKE_MAP).sum() < 400


def test_the_limit_of_unlike_grasps_can_be_set() -> None:
    """180 degrees is the paper's: everything is matched."""
    v = axes_of_map()[:1] @ Rotation.from_rotvec([0.2, 0, 0]).as_matrix().T
    angle = np.degrees(RANKER.rank(POINT, v, max_angle_deg=180.0).angle[0])
    assert RANKER.rank(POINT, v, max_angle_deg=angle - 0.01).status[0] == UNLIKE_MAP
    assert RANKER.rank(POINT, v, max_angle_deg=angle + 0.01).status[0] != UNLIKE_MAP
    turned = RANKER.rank(POINT, -axes_of_map()[:1], max_angle_deg=180.0)
    assert turned.status[0] not in (UNLIKE_MAP, OUTSIDE_MAP, INVALID)


def test_wrong_rows_are_marked_and_leave_the_others_alone() -> None:
    """NaN, zero directions and matrices that are no rotations, among good ones."""
    good = axes_of_map()[:3]
    points = np.tile(POINT, (6, 1))
    points[1, 0] = np.nan
    v = np.vstack([good[0], good[0], [0, 0, 0], good[1], [np.inf, 0, 0], good[2]])
    ranking = RANKER.rank(points, v)
    assert (ranking.status == INVALID).tolist() == [
        False,
        True,
        True,
        False,
        True,
        False,
    ]
    alone = RANKER.rank(np.tile(POINT, (3, 1)), good)
    np.testing.assert_array_equal(ranking.cost[[0, 3, 5]], alone.cost)
    assert (ranking.test_grasp[[1, 2, 4]] == -1).all()
    with pytest.raises(SettingsError, match="rows 1, 2, 4: expected finite points"):
        RANKER.rank(points, v, invalid="raise")
    mirrored = RANKER.rank(POINT, rotations=np.diag([1.0, 1.0, -1.0]))
    assert mirrored.status.tolist() == [INVALID]


def test_quaternions_rotations_lists_and_single_grasps_are_one() -> None:
    """The same grasps in five spellings; the order of quaternions is named."""
    wxyz = BIN_MAP.quaternion_wxyz[0, 2, 3, :4]
    points = np.tile(POINT, (4, 1))
    R = Rotation.from_quat(np.roll(wxyz, -1, axis=1)).as_matrix()
    expected = RANKER.rank(points, rotations=R).cost
    spellings = [
        RANKER.rank(points, quaternions_wxyz=wxyz),
        RANKER.rank(points, quaternions_wxyz=2.0 * wxyz),
        RANKER.rank(points, quaternions_xyzw=np.roll(wxyz, -1, axis=1)),
        RANKER.rank(points.tolist(), rotations=R.tolist()),
    ]
    for ranking in spellings:
        np.testing.assert_allclose(ranking.cost, expected, rtol=1e-12)
    one = RANKER.rank(POINT.tolist(), quaternions_wxyz=wxyz[0].tolist())
    np.testing.assert_allclose(one.cost, expected[:1], rtol=1e-12)
    assert RANKER.rank([], []).order.shape == (0,)
    zero = RANKER.rank(POINT, quaternions_wxyz=[0, 0, 0, 0])
    assert zero.status.tolist() == [INVALID]


def test_grasps_beyond_the_outermost_points_say_so() -> None:
    """Half a square further than the last test point, but still inside the map."""
    T = BIN_MAP.bin_pose
    x, y = BIN_MAP.x[-1], BIN_MAP.y[0]
    step = 0.3 * (BIN_MAP.x[1] - BIN_MAP.x[0])
    local = np.array([[x, y, 0.0], [x + step, y, 0.0], [BIN_MAP.x[0], y - step, 0.0]])
    local[:, 2] = BIN_MAP.layer[0]
    ranking = RANKER.rank(
        local @ T[:3, :3].T + T[:3, 3], np.repeat(axes_of_map()[:1], 3, 0)
    )
    assert (ranking.status != OUTSIDE_MAP).all()
    assert ranking.extrapolated.tolist() == [False, True, True]


def run(*arguments: str) -> Result:
    """Run `reachmap rank`."""
    return CliRunner().invoke(group, ["rank", *arguments])


def written(folder: Path, change: str) -> str:
    """A list of the examples with one of the usual mistakes."""
    data = json.loads((folder / "pile-1.json").read_text())
    for grasp in data["grasps"]:
        if "normals" in change:
            grasp["direction"] = [-value for value in grasp["direction"]]
        if "millimetres" in change:
            grasp["position"] = [1000.0 * value for value in grasp["position"]]
        if "camera" in change:
            grasp["position"][2] += 0.6
            grasp["direction"][2] *= -1.0
    (folder / "odd.json").write_text(json.dumps(data))
    return "odd.json"


@pytest.mark.parametrize(
    ("change", "question"),
    [
        ("normals", "are these outward normals?"),
        ("millimetres", "are these millimetres?"),
        ("normals and millimetres", "are these outward normals in millimetres?"),
        ("camera", "are the frame (bin) and the map right?"),
    ],
)
def test_usual_mistakes_are_asked_about(
    folder: Path, change: str, question: str
) -> None:
    """Nothing of such a list is called reachable; the question names the mistake."""
    result = run(written(folder, change))
    if "millimetres" in change and result.exit_code == 2:
        assert "millimetres" in result.stderr
        return
    assert question in result.stderr
    document = json.loads(result.stdout)
    states = Counter(g["reachmap"]["status"] for g in document["grasps"])
    assert set(states) <= {"unlike_map", "outside_map"}
    assert any(question in doubt for doubt in document["reachmap"]["doubts"])


@pytest.mark.parametrize(
    ("change", "question"),
    [
        ("shrunk", "are these metres, not millimetres?"),
        ("exchanged", "turned by a quarter about z"),
        ("other base", "turned by half about z"),
    ],
)
def test_frames_and_units_that_nearly_fit_are_asked_about(
    folder: Path, change: str, question: str
) -> None:
    """Metres called millimetres fall onto the origin; x and y exchanged mostly fit."""
    data = json.loads((folder / "pile-1.json").read_text())
    T = BIN_MAP.bin_pose
    for grasp in data["grasps"]:
        point, axis = (np.array(grasp[name]) for name in ("position", "direction"))
        if change == "exchanged":
            point, axis = point[[1, 0, 2]], axis[[1, 0, 2]]
        if change == "other base":
            point, axis = T[:3, :3] @ point + T[:3, 3], T[:3, :3] @ axis
            point, axis = point * [-1, -1, 1], axis * [-1, -1, 1]
            data["frame"] = "robot_base"
        grasp["position"], grasp["direction"] = point.tolist(), axis.tolist()
    if change == "shrunk":
        data["units"] = {"length": "mm"}
    (folder / "odd.json").write_text(json.dumps(data))
    result = run("odd.json")
    assert question in result.stderr
    (doubt,) = json.loads(result.stdout)["reachmap"]["doubts"]
    assert question in doubt


@pytest.mark.parametrize(
    ("key", "order", "question"),
    [
        ("quaternion_wxyz", [1, 2, 3, 0], "are quaternions in the other order?"),
        ("quaternion_xyzw", [0, 1, 2, 3], "are quaternions in the other order?"),
        ("quaternion_wxyz", [0, 1, 2, 3], "does the tool's roll not matter?"),
    ],
)
def test_orientations_that_do_not_fit_are_asked_about(
    folder: Path, key: str, order: list[int], question: str
) -> None:
    """Quaternions of the map in the wrong order, and turned away about the approach."""
    place = (0, 2, 3)
    R = Rotation.from_quat(np.roll(BIN_MAP.quaternion_wxyz[place], -1, axis=1))
    if "roll" in question:
        axis = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}
        turn = np.array(axis[BIN_MAP.approach_axis[1]])
        # As far from the rolls of each direction as can be.
        R = max(
            (R[:1] * Rotation.from_rotvec(a * turn) for a in np.linspace(0, 6.2, 60)),
            key=lambda one: min((one.inv() * R).magnitude()),
        )
    wxyz = np.roll(R.as_quat(), 1, axis=1)
    grasps = [{"position": POINT.tolist(), key: q[order].tolist()} for q in wxyz]
    head = {"format": "reachmap.grasps", "format_version": "1.0"}
    axis_name = {"approach_axis": BIN_MAP.approach_axis, "frame": "robot_base"}
    (folder / "odd.json").write_text(
        json.dumps({**head, **axis_name, "grasps": grasps})
    )
    result = run("odd.json")
    assert result.exit_code == 0, result.stderr
    assert question in result.stderr


def test_rows_of_a_list_that_are_no_grasps_can_be_marked(folder: Path) -> None:
    """With --invalid mark they come last, and the others are ranked as without them."""
    data = json.loads((folder / "pile-1.json").read_text())
    good = json.loads(run("pile-1.json").stdout)["grasps"]
    down = {"direction": [0.0, 0.0, -1.0]}
    bad = [
        {"id": "nan", "position": [float("nan"), 0.0, 0.0], **down},
        {"id": "nowhere", "position": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, 0.0]},
        {"id": "long", "position": [0.0, 0.0, 0.0], "quaternion_wxyz": [0, 2, 0, 0]},
        {"id": "mirror", "position": [0.0, 0.0, 0.0],
         "rotation_matrix": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]},
    ]  # fmt: skip
    data["grasps"][3:3] = bad
    (folder / "odd.json").write_text(json.dumps(data))
    refused = run("odd.json")
    assert refused.exit_code == 2
    assert refused.stdout == ""
    assert "grasps[3].position[0]: expected a finite number" in refused.stderr
    result = run("odd.json", "--invalid", "mark")
    assert result.exit_code == 0
    assert "grasps[3].position[0]: expected a finite number (got NaN)" in result.stderr
    ranked = json.loads(result.stdout, parse_constant=lambda name: pytest.fail(name))
    schema = json.loads(CliRunner().invoke(group, ["schema", "ranked"]).stdout)
    jsonschema.validate(ranked, schema)
    marked = [g["id"] for g in ranked["grasps"] if g["reachmap"]["status"] == "invalid"]
    assert marked == [g["id"] for g in bad]
    others = [g for g in ranked["grasps"] if g["id"] not in marked]
    assert [(g["id"], g["reachmap"]["cost"]) for g in others] == [
        (g["id"], g["reachmap"]["cost"]) for g in good
    ]


def test_what_is_no_number_of_a_grasp_is_refused_all_the_same(folder: Path) -> None:
    """A misspelt key is the mistake of whoever writes the lists."""
    data = json.loads((folder / "pile-1.json").read_text())
    data["grasps"][0]["approach"] = data["grasps"][0].pop("direction")
    (folder / "odd.json").write_text(json.dumps(data))
    result = run("odd.json", "--invalid", "mark")
    assert result.exit_code == 2
    assert "approach: unknown key; called direction here" in result.stderr


def test_one_grasp_at_the_origin_raises_no_question(folder: Path) -> None:
    """It is in no unit at all."""
    data = json.loads((folder / "pile-1.json").read_text())
    data["grasps"] = [{"position": [0.0, 0.0, 0.0], "direction": [0.0, 0.0, -1.0]}]
    (folder / "odd.json").write_text(json.dumps(data))
    assert json.loads(run("odd.json").stdout)["reachmap"]["doubts"] == []


def test_a_list_that_fits_raises_no_question(folder: Path) -> None:
    """As supplied."""
    result = run("pile-1.json")
    assert json.loads(result.stdout)["reachmap"]["doubts"] == []
    assert result.stderr == ""


@pytest.mark.parametrize(
    ("options", "code"),
    [
        (["--min-reachable", "1"], 0),
        (["--min-reachable", "168"], 1),
        (["--min-reachable", "1%"], 0),
        (["--min-reachable", "99%"], 1),
        (["--min-reachable", "200%"], 2),
        (["--min-reachable", "few"], 2),
        (["--fail-if-none-reachable"], 0),
    ],
)
def test_gates(folder: Path, options: list[str], code: int) -> None:
    """A gate that does not hold is exit code 1, after the answer was given."""
    result = run("pile-1.json", *options)
    assert result.exit_code == code
    if code == 1:
        assert json.loads(result.stdout)["grasps"]
        assert "grasps are reachable" in result.stderr


@pytest.mark.parametrize("change", ["", "normals", "camera"])
def test_ranked_lists_follow_their_schema(folder: Path, change: str) -> None:
    """Reachable grasps, unreachable ones and such that the map does not know."""
    result = run(written(folder, change), "--likeness", "0.5")
    schema = json.loads(CliRunner().invoke(group, ["schema", "ranked"]).stdout)
    jsonschema.validate(json.loads(result.stdout), schema)


def test_a_list_without_reachable_grasps_can_fail(folder: Path) -> None:
    """A reversed list, which is unlike the map."""
    result = run(written(folder, "normals"), "--fail-if-none-reachable")
    assert result.exit_code == 1
    assert "0 of 167 grasps are reachable" in result.stderr
