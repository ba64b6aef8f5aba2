"""Each rule of the optional parts can be broken, and is then named."""

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from reachmap.maps.format.bin import BIN, tree_from_bin_map
from reachmap.maps.format.placement import PLACEMENT, tree_from_placement
from reachmap.maps.format.store import check_tree
from reachmap.maps.format.workspace import WORKSPACE, tree_from_workspace_map
from reachmap.maps.records import BinMap, Status
from tests.support.optional import present
from tests.support.synthetic_maps import (
    synthetic_bin_map,
    synthetic_placement,
    synthetic_workspace_map,
)
from tests.support.synthetic_parts import (
    bin_with_parts,
    placement_with_parts,
    workspace_with_parts,
)


@pytest.fixture(scope="module")
def record() -> BinMap:
    """A sound bin map with every part; the roadmap alone reaches some test grasps."""
    connected = np.random.default_rng(2).random((1, 3, 4, 5)) < 0.6
    map_with_all = bin_with_parts(
        synthetic_bin_map(0.3, shape=(1, 3, 4, 5, 2), connected=connected)
    )
    assert not problems_of(map_with_all)
    return map_with_all


def problems_of(record: BinMap) -> list[str]:
    """What the format says of a bin map."""
    return check_tree(tree_from_bin_map(record), BIN)


def put(array: Any, where: Any, value: Any) -> Any:
    """A copy with the first element that is ``where`` changed."""
    copy = np.array(array)
    copy[tuple(np.argwhere(where)[0])] = value
    return copy


def found(r: BinMap) -> Any:
    """Test grasps with a path."""
    return r.status == Status.PATH_FOUND


Change = Callable[[BinMap], dict[str, Any]]


def part(name: str, **changes: Callable[[Any], Any]) -> Change:
    """Change fields of one part of a map."""
    return lambda r: {
        name: dataclasses.replace(
            getattr(r, name), **{key: make(r) for key, make in changes.items()}
        )
    }


RULES: list[tuple[str, Change, str]] = [
    ("a component beyond the table",
     lambda r: {"component": put(r.component, found(r), 3)}, "count in /components"),
    ("a reached component without a path",
     lambda r: {"component": put(r.component, r.status == 4, 0)},
     "must not be no_path_found in a component that is reached"),
    ("checks that do not add up",
     part("components", checks=lambda r: r.components.checks + 1), "must add up"),
    ("checks without a goal",
     part("effort", checks=lambda r: put(r.effort.checks, (r.n_ik_free == 0)[..., None]
          & (r.path_found >= 0), 7)), "must be 0 where no goal is free"),
    ("checks that cost nothing",
     part("effort", seconds_per_check=lambda r: 0.0), "seconds_per_check"),
    ("a best path that is missing",
     part("best", row=lambda r: put(r.best.row, found(r), -1)), "exactly where"),
    ("a best path beyond the store",
     part("best", row=lambda r: put(r.best.row, found(r), 9999)), "must be a row"),
    ("a best path to another grasp",
     part("best", row=lambda r: put(r.best.row, found(r), r.best.row.max())),
     "lead to its own"),
    ("a best path of another length",
     part("best", path_length=lambda r: r.best.path_length + 1.0), "be the length"),
    ("a goal that is not the end of the path",
     lambda r: {"goal_configuration": r.goal_configuration + 0.1},
     "where best_path ends"),
    ("a roll without a path",
     lambda r: {"winning_roll": put(r.winning_roll, ~found(r), 0.5)}, "winning_roll"),
    ("an approach that takes longer than the whole",
     part("times", approach=lambda r: r.times.approach * 100), "less than approach"),
    ("a retreat that is missing",
     part("times", retreat=lambda r: r.times.retreat * np.nan), "retreat_time must be"),
    ("a clearance between no bodies",
     part("margins", clearance_pair=lambda r: put(r.margins.clearance_pair, found(r),
          -1)), "names a pair"),
    ("a margin without a path",
     part("margins", joint_margin=lambda r: put(r.margins.joint_margin, ~found(r),
          0.1)), "must be NaN unless"),
    ("a negative clearance",
     part("margins", clearance=lambda r: -r.margins.clearance), "goes below 0"),
    ("a stage with a path and a blocking pair",
     part("cycle", blocking_pair=lambda r: put(r.cycle.blocking_pair,
          r.cycle.status == 1, 0)), "must be -1 where the stage"),
    ("a stage without a time",
     part("cycle", time=lambda r: r.cycle.time * np.nan), "stage_time must be finite"),
    ("a whole cycle that goes nowhere",
     part("cycle", drop_off=lambda r: np.full_like(r.cycle.drop_off, -1)),
     "drop_off must be given"),
    ("a share of cycles that is not that of the stages",
     part("cycle", reachability=lambda r: r.cycle.reachability * 0.5),
     "what Eq. (1) gives"),
    ("a cycle time without a cycle",
     part("cycle", cycle_time=lambda r: put(r.cycle.cycle_time, ~found(r), 1.0)),
     "exactly where every stage"),
    ("a stage that the cycle does not have",
     part("paths", stage=lambda r: r.paths.stage + 9), "count the stages"),
    ("a later stage that claims to be an attempt",
     part("paths", index=lambda r: np.where(r.paths.index == -1, 0, r.paths.index)),
     "paths/"),
    ("a world that mirrors",
     lambda r: {"T_world_base": np.diag([1.0, 1.0, -1.0, 1.0])}, "must not mirror"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("change", "message"),
    [pytest.param(change, message, id=name) for name, change, message in RULES],
)
def test_rules_of_the_parts_of_a_bin_map(
    record: BinMap, change: Change, message: str
) -> None:
    """One wrong number is found, and its variable named."""
    problems = problems_of(dataclasses.replace(record, **change(record)))
    assert any(message in text for text in problems), problems


@pytest.mark.parametrize("name", ["effort", "best", "margins", "cycle", "components"])
def test_a_part_may_be_left_out(record: BinMap, name: str) -> None:
    """Without it, the rest is still sound."""
    changes: dict[str, Any] = {name: None}
    if name == "cycle":
        assert (present(record.paths.stage) == 0).any()
        changes["paths"] = without_stages(record)
    if name == "components":
        changes["component"] = None
    assert not problems_of(dataclasses.replace(record, **changes))


def without_stages(record: BinMap) -> Any:
    """The paths to the grasps alone, which are the first."""
    count = int((present(record.paths.stage) == 0).sum())
    points = int(record.paths.row_size[:count].sum())
    return dataclasses.replace(
        record.paths,
        configuration=record.paths.configuration[:points],
        row_size=record.paths.row_size[:count],
        planned_size=record.paths.planned_size[:count],
        index=record.paths.index[:count],
        stage=None,
    )


def test_half_a_part_is_refused(record: BinMap) -> None:
    """A file has all variables of a part or none."""
    tree = tree_from_bin_map(record)
    leaves = {key: leaf for key, leaf in tree.leaves.items() if key != "joint_margin"}
    problems = check_tree(dataclasses.replace(tree, leaves=leaves), BIN)
    assert problems == ["joint_margin is missing"]


def test_rules_of_the_other_formats() -> None:
    """Cubes against their components, a placement against its scores."""
    workspace = workspace_with_parts(
        synthetic_workspace_map(np.full((1, 3, 2), 0.5), shared_row=1)
    )
    tree = tree_from_workspace_map(workspace)
    assert not check_tree(tree, WORKSPACE)
    components = present(workspace.components)
    reached = dataclasses.replace(components, reached=np.ones_like(components.reached))
    broken = dataclasses.replace(workspace, components=reached)
    problems = check_tree(tree_from_workspace_map(broken), WORKSPACE)
    assert any("component that is reached" in text for text in problems)
    placement = placement_with_parts(synthetic_placement())
    assert not check_tree(tree_from_placement(placement), PLACEMENT)
    unsure = dataclasses.replace(
        placement, score_error=np.full_like(placement.score, 1.0)
    )
    problems = check_tree(tree_from_placement(unsure), PLACEMENT)
    assert any("score_error must be NaN" in text for text in problems)
