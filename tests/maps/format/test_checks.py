"""Every rule about numbers that must agree is noticed when broken."""

import dataclasses
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from reachmap.maps import BinMap, BinPlacement, PathStore, Status, WorkspaceMap
from reachmap.maps.bytes.tree import Leaf, Tree
from reachmap.maps.format.bin import BIN, tree_from_bin_map
from reachmap.maps.format.checks import check_structure, path_lengths
from reachmap.maps.format.placement import PLACEMENT, tree_from_placement
from reachmap.maps.format.store import check_tree
from reachmap.maps.format.workspace import WORKSPACE, tree_from_workspace_map
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_workspace_map,
)


def workspace() -> WorkspaceMap:
    """A map with every status but error, in two cubes."""
    return synthetic_workspace_map(
        np.random.default_rng(3).random((2, 5, 4)), shared_row=2
    )


def problems_of(record: WorkspaceMap | BinMap | BinPlacement) -> list[str]:
    """What is wrong with a record."""
    if isinstance(record, WorkspaceMap):
        return check_tree(tree_from_workspace_map(record), WORKSPACE)
    if isinstance(record, BinMap):
        return check_tree(tree_from_bin_map(record), BIN)
    return check_tree(tree_from_placement(record), PLACEMENT)


def first(mask: Any) -> tuple[int, ...]:
    """Index of the first True."""
    return tuple(int(i) for i in np.argwhere(mask)[0])


def changed(array: np.ndarray, index: Any, value: float) -> np.ndarray:
    """A copy with one number replaced."""
    copy = array.copy()
    copy[index] = value
    return copy


def test_the_synthetic_maps_are_sound() -> None:
    """What the other tests break is whole to begin with."""
    assert problems_of(workspace()) == []
    assert problems_of(synthetic_bin_map()) == []
    assert problems_of(synthetic_bin_map(0.0)) == []
    assert problems_of(synthetic_placement()) == []


CUBE_RULES: list[tuple[str, Status, float, str]] = [
    ("path_length", Status.PATH_FOUND, np.nan, "path_length must be finite"),
    ("path_length", Status.NO_IK, 1.0, "path_length must be finite"),
    ("path_length", Status.PATH_FOUND, -1.0, "path_length goes below 0"),
    ("path_length", Status.PATH_FOUND, np.inf, "not finite"),
    ("blocking_pair", Status.IK_IN_COLLISION, -1, "must name a pair"),
    ("blocking_pair", Status.PATH_FOUND, 0, "must be -1 where nothing"),
    ("blocking_pair", Status.IK_IN_COLLISION, 3, "blocking_pair goes above 2"),
    ("blocking_pair", Status.IK_IN_COLLISION, -2, "blocking_pair goes below"),
    ("n_ik", Status.NO_IK, 1, "n_ik must be 0 where the status is no_ik"),
    ("n_ik_free", Status.NO_IK, 1, "n_ik_free must not exceed n_ik"),
    ("n_ik_free", Status.IK_IN_COLLISION, 1, "all are in collision"),
    ("n_ik_free", Status.NO_PATH_FOUND, 0, "where a path was sought"),
    ("paths_found", Status.NO_PATH_FOUND, 1, "paths_found must be 0 unless"),
    ("paths_found", Status.PATH_FOUND, 6, "must not exceed attempts"),
    ("goal_configuration", Status.PATH_FOUND, np.nan, "must be there where"),
    ("status", Status.PATH_FOUND, 7, "status goes above 6"),
    ("status", Status.PATH_FOUND, 4, "path_reachability must be what Eq"),
    ("component", Status.PATH_FOUND, -2, "component goes below -1"),
]


@pytest.mark.parametrize(("name", "where", "value", "message"), CUBE_RULES)
def test_rules_of_a_cube(name: str, where: Status, value: float, message: str) -> None:
    """One wrong number in one frame of one cube is found."""
    record = workspace()
    cube = record.cubes["left"]
    index = first(cube.status == where)
    broken = dataclasses.replace(
        cube, **{name: changed(getattr(cube, name), index, value)}
    )
    if name == "status" and value == 4:
        # Everything that goes with the status follows it; only the share is stale.
        broken = dataclasses.replace(
            broken,
            path_length=changed(broken.path_length, index, np.nan),
            paths_found=changed(broken.paths_found, index, 0),
        )
    cubes = {**record.cubes, "left": broken}
    found = problems_of(dataclasses.replace(record, cubes=cubes))
    assert any(message in text for text in found), found


def test_half_a_goal_is_no_goal() -> None:
    """A goal configuration has all joints or none."""
    record = workspace()
    cube = record.cubes["right"]
    index = (*first(cube.status == Status.PATH_FOUND), 2)
    goal = changed(cube.goal_configuration, index, np.nan)
    cubes = {
        **record.cubes,
        "right": dataclasses.replace(cube, goal_configuration=goal),
    }
    found = problems_of(dataclasses.replace(record, cubes=cubes))
    assert any("must be whole or absent" in text for text in found)


def test_quaternions_have_length_one() -> None:
    """A quaternion of another length is refused, not normalised in silence."""
    record = workspace()
    cube = record.cubes["left"]
    cubes = {
        **record.cubes,
        "left": dataclasses.replace(cube, quaternion_wxyz=cube.quaternion_wxyz * 1.01),
    }
    found = problems_of(dataclasses.replace(record, cubes=cubes))
    assert any("unit quaternions (4 of 4 do not)" in text for text in found)


@pytest.mark.parametrize("kind", ["path", "ik", "ik_free"])
def test_stitched_percentages_are_those_of_the_status(kind: str) -> None:
    """Each of the three percentages is computed again from the frames."""
    record = workspace()
    name = f"{kind}_reachability"
    values: Any = changed(getattr(record, name), (1, 2, 3), 12.5)
    found = problems_of(dataclasses.replace(record, **{name: values}))
    assert found == [
        f"{name} must be what Eq. (1) gives for the status (1 of 40 do not)"
    ]


def test_the_stitched_lattice_is_the_union_of_the_cubes() -> None:
    """Coordinates that no cube has are noticed."""
    record = workspace()
    moved = dataclasses.replace(record, y=record.y + 0.05)
    assert problems_of(moved) == ["y is not the union of the cubes' y"]


BIN_RULES: list[tuple[str, Callable[[BinMap], dict[str, Any]], str]] = [
    (
        "a length without a path",
        lambda r: {
            "path_length": changed(r.path_length, first(r.path_found == 0), 1.0)
        },
        "path_length must be finite exactly where path_found is 1",
    ),
    (
        "a path without a time",
        lambda r: {
            "planning_cpu_time": changed(
                r.planning_cpu_time, first(r.path_found == 1), np.nan
            )
        },
        "planning_cpu_time must be finite exactly",
    ),
    (
        "a found path and another status",
        lambda r: {
            "status": changed(
                r.status, first(r.path_found.any(axis=-1)), Status.NO_PATH_FOUND
            )
        },
        "status must be path_found where an attempt found a path",
    ),
    (
        "reachable by nothing",
        lambda r: {
            "path_found": np.zeros_like(r.path_found),
            "connected": np.zeros_like(r.connected),
        },
        "without an attempt or a connection",
    ),
    (
        "a flag that is neither",
        lambda r: {"connected": changed(r.connected, (0, 0, 0, 0), 2)},
        "connected goes above 1",
    ),
    (
        "a share off by a little",
        lambda r: {
            "path_reachability": changed(r.path_reachability, (0, 1, 1), 50.0001)
        },
        "path_reachability must be what Eq. (1) gives",
    ),
    (
        "a bin that is stretched",
        lambda r: {"bin_pose": changed(r.bin_pose, (0, 0), 0.5)},
        "bin_pose must hold a rotation",
    ),
    (
        "a bin that is mirrored",
        lambda r: {"bin_pose": np.diag([1.0, 1.0, -1.0, 1.0])},
        "bin_pose must not mirror",
    ),
    (
        "no homogeneous matrix",
        lambda r: {"bin_pose": np.ones((4, 4))},
        "bin_pose must be a homogeneous matrix",
    ),
    ("rows that fall", lambda r: {"y": r.y[::-1].copy()}, "y must rise"),
    ("an unknown axis", lambda _: {"approach_axis": "z"}, "approach_axis must be one"),
    ("a negative approach", lambda _: {"approach_distance": -0.1}, "must be a length"),
]


@pytest.mark.parametrize(
    ("change", "message"),
    [rule[1:] for rule in BIN_RULES],
    ids=[rule[0] for rule in BIN_RULES],
)
def test_rules_of_a_bin_map(
    change: Callable[[BinMap], dict[str, Any]], message: str
) -> None:
    """Attempts, status, shares, pose and grid of a bin map agree."""
    record = synthetic_bin_map(0.4)
    found = problems_of(dataclasses.replace(record, **change(record)))
    assert any(message in text for text in found), found


PATH_RULES: list[tuple[str, Callable[[PathStore], dict[str, Any]], str]] = [
    (
        "points left over",
        lambda p: {"row_size": changed(p.row_size, 0, p.row_size[0] - 1)},
        "row_size must add up",
    ),
    (
        "more planned than there are",
        lambda p: {"planned_size": changed(p.planned_size, 0, p.row_size[0] + 1)},
        "planned_size must not exceed",
    ),
    (
        "a repeat that is not",
        lambda p: {"index": changed(p.index, (0, 4), 99)},
        "must name test grasps and attempts",
    ),
    (
        "a waypoint moved",
        lambda p: {
            "configuration": changed(
                p.configuration, (1, 0), p.configuration[1, 0] + 0.1
            )
        },
        "as long as path_length says (1 of",
    ),
]


@pytest.mark.parametrize(
    ("change", "message"),
    [rule[1:] for rule in PATH_RULES],
    ids=[rule[0] for rule in PATH_RULES],
)
def test_rules_of_stored_paths(
    change: Callable[[PathStore], dict[str, Any]], message: str
) -> None:
    """A stored path is whole, of an attempt that found one, and as long as it says."""
    record = synthetic_bin_map(0.4)
    paths = dataclasses.replace(record.paths, **change(record.paths))
    found = problems_of(dataclasses.replace(record, paths=paths))
    assert any(message in text for text in found), found


def test_path_lengths_agree_with_a_loop() -> None:
    """Ragged lengths against one path at a time, single points included."""
    rng = np.random.default_rng(5)
    rows = np.array([3, 1, 4, 2])
    planned = np.array([2, 1, 4, 1])
    points = rng.normal(size=(rows.sum(), 6))
    whole, part = path_lengths(points, rows, planned)
    start = 0
    for k, (n, m) in enumerate(zip(rows, planned, strict=True)):
        path = points[start : start + n]
        steps = [np.linalg.norm(b - a) for a, b in pairwise(path)]
        assert whole[k] == pytest.approx(sum(steps))
        assert part[k] == pytest.approx(sum(steps[: m - 1]))
        start += n


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"chosen": 4}, "chosen must be a row"),
        ({"runner_up": -2}, "runner_up must be a row"),
        ({"reason": ("", "", "", "")}, "reason must be given exactly"),
        ({"reason": ("why", "", "", "why")}, "reason must be given exactly"),
        ({"chosen": 1}, "bin_pose must be the pose of the chosen"),
        ({"margin": {"+x": -0.1}}, "shift_margin goes below 0"),
        ({"joint_names": ("a",)}, "dimensions say (1,)"),
    ],
)
def test_rules_of_a_placement(changes: dict[str, Any], message: str) -> None:
    """Rows, reasons, margins and the chosen pose of a placement agree."""
    found = problems_of(synthetic_placement(**changes))
    assert any(message in text for text in found), found


def without(tree: Tree, path: str) -> Tree:
    """The tree lacking one leaf."""
    leaves = {k: v for k, v in tree.leaves.items() if k != path}
    return dataclasses.replace(tree, leaves=leaves)


def with_leaf(tree: Tree, path: str, **changes: Any) -> Tree:
    """The tree with one leaf changed."""
    leaf = dataclasses.replace(tree.leaves[path], **changes)
    return dataclasses.replace(tree, leaves={**tree.leaves, path: leaf})


def test_structure_is_compared_with_the_layout() -> None:
    """Missing variables, wrong types, dimensions, units and lists are all named."""
    tree = tree_from_placement(synthetic_placement())
    status = np.zeros(4)
    cases = [
        (without(tree, "score"), "score is missing"),
        (with_leaf(tree, "exact", value=status), "exact has the type float64, not u1"),
        (with_leaf(tree, "score", dims=("shift",)), "score has the dimensions (shift)"),
        (with_leaf(tree, "score", attributes={}), "score has the unit None"),
        (with_leaf(tree, "score", value="98"), "score is a text"),
        (
            with_leaf(tree, "score", value=np.zeros(3)),
            "score has the shape (3,), its dimensions say (4,)",
        ),
        (
            with_leaf(tree, "reason", attributes={"units": "1"}),
            "reason lacks its list reasons",
        ),
        (dataclasses.replace(tree, attributes={}), "root attribute chosen is missing"),
    ]
    assert check_structure(tree, PLACEMENT) == []
    for broken, message in cases:
        found = check_structure(broken, PLACEMENT)
        assert any(message in text for text in found), (message, found)


def test_variables_of_a_newer_minor_version_are_let_be() -> None:
    """What the layout does not know is not a mistake."""
    tree = tree_from_placement(synthetic_placement())
    extra = Leaf(value=np.zeros(4), dims=("candidate",))
    newer = dataclasses.replace(tree, leaves={**tree.leaves, "novelty": extra})
    assert check_tree(newer, PLACEMENT) == []
