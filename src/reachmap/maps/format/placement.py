"""Bin placements: record to file and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from reachmap.geometry import transform_points
from reachmap.maps.bytes.tree import Tree
from reachmap.maps.format.assembly import (
    assemble,
    origin_of,
    section_arrays,
    sections_of,
)
from reachmap.maps.format.candidates import (
    REASON,
    margin_variables,
    of_candidate,
    packed,
    reason_problems,
    row_problems,
    unpacked,
)
from reachmap.maps.format.checks import check_pose, check_world, require
from reachmap.maps.format.layout import JOINT, PERCENT, SCAN, Layout, Variable, index
from reachmap.maps.format.sections import PLACEMENT_SECTIONS
from reachmap.maps.format.store import RecordFile
from reachmap.maps.records import BinPlacement


def check_placement(tree: Tree) -> list[str]:
    """Check the chosen row against the pose, and reasons against missing scores."""
    score = tree.array("score")
    problems = [*check_pose(tree.array("bin_pose")), *check_world(tree)]
    for name in ("worst_score", "score_error"):
        if name in tree.leaves:
            problems += require(
                ~np.isnan(score) | np.isnan(tree.array(name)),
                f"{name} must be NaN where a candidate has no score",
            )
    problems += row_problems(tree, {"chosen": 0, "runner_up": -1, "paper_choice": -1})
    problems += reason_problems(tree)
    if not problems:
        chosen = tree.array("candidate_position")[tree.attributes["chosen"]]
        if not np.allclose(chosen, tree.array("bin_pose")[:3, 3], atol=1e-6):
            problems.append("bin_pose must be the pose of the chosen candidate")
    return problems


PLACEMENT = Layout(
    kind="bin_placement",
    check=check_placement,
    sections=PLACEMENT_SECTIONS,
    title="Where the bin goes in a robot cell",
    signal="score",
    axes=("candidate",),
    attributes={
        "chosen": "Row of the chosen candidate.",
        "runner_up": "Row of the best candidate in another place, -1: none.",
        "paper_choice": "Row of the paper's own choice, -1: none.",
        "rule": "Rule that chose: `search`, `paper` or `given`.",
        "joint_names": "Names of the joints, in order.",
        "reasons": "Reasons for excluding a candidate; the first is the empty one.",
    },
    variables=(
        index("candidate", "Poses that were considered."),
        JOINT,
        index("pose_row", "Rows of a homogeneous matrix."),
        index("pose_column", "Columns of a homogeneous matrix."),
        index("xyz", "Coordinates x, y, z."),
        index("shift", "Directions of shift_margin.", labels="shift_directions"),
        index("turn", "Directions of turn_margin.", labels="turn_directions"),
        Variable(
            path="bin_pose",
            dims=("pose_row", "pose_column"),
            dtype="f8",
            units="m",
            meaning="T_base_bin of the chosen bin; the rotation block has no unit.",
            frame="robot_base",
        ),
        SCAN,
        Variable(
            path="candidate_position",
            dims=("candidate", "xyz"),
            dtype="f8",
            units="m",
            meaning="Centre of the bin's inner bottom.",
            frame="robot_base",
        ),
        of_candidate(
            "candidate_yaw",
            "f8",
            "rad",
            "Angle of the bin about the vertical.",
            frame="robot_base",
        ),
        of_candidate(
            "score",
            "f8",
            meaning="Mean path reachability over the pick volume; NaN: excluded.",
            nan=True,
            **PERCENT,
        ),
        of_candidate(
            "worst_point",
            "f8",
            meaning="Path reachability of the worst point of the pick volume.",
            nan=True,
            **PERCENT,
        ),
        of_candidate(
            "reachable_share",
            "f8",
            meaning="Share of test frames that can be reached.",
            nan=True,
            **PERCENT,
        ),
        of_candidate(
            "exact",
            "u1",
            "1",
            "1 where the bin was in the scene, 0 where the map was interpolated.",
            is_flag=True,
        ),
        REASON,
        *margin_variables(
            "How far the bin can be moved before the score drops by 5 points.",
            "How far the bin can be turned before the score drops by 5 points.",
        ),
    ),
)


_ARRAYS = (
    "bin_pose", "scan_configuration", "score", "worst_point", "reachable_share",
    "exact",
)  # fmt: skip
_ROWS = ("chosen", "runner_up", "paper_choice")


def tree_from_placement(record: BinPlacement) -> Tree:
    """Everything that the file will hold."""
    of_reasons, labels = packed(record)
    poses, T = np.reshape(record.candidate_pose, (-1, 4)), record.T_base_level
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _ARRAYS}
    arrays.update(
        candidate_position=transform_points(T, poses[:, :3]),
        candidate_yaw=poses[:, 3],
        **of_reasons,
    )
    layout = PLACEMENT.in_frame("T_base_level", T, ("candidate_yaw",), "level")
    optional, lists, numbers = section_arrays(layout, record)
    texts = {} if record.support is None else {"support": record.support}
    return assemble(
        layout,
        arrays={**arrays, **optional},
        attributes={
            **{name: int(getattr(record, name)) for name in _ROWS},
            "rule": record.rule,
        },
        labels={
            "joint_names": record.joint_names,
            **labels,
            "tolerance_parts": ("shift_m", "turn_rad"),
            **lists,
        },
        numbers=numbers,
        texts=texts,
        stamp=record.stamp,
        provenance=record.provenance,
        run=record.run,
    )


def placement_from_tree(tree: Tree, path: Path) -> BinPlacement:
    """Turn a checked tree into a record; ``path`` is named in messages."""
    stored: dict[str, Any] = {name: tree.array(name) for name in _ARRAYS}
    stored.update({name: int(tree.attributes[name]) for name in _ROWS})
    optional = sections_of(PLACEMENT, tree)
    if "tolerance" in optional:
        optional["tolerance"] = tuple(optional["tolerance"].tolist())
    T = optional.setdefault("T_base_level", np.eye(4))
    position = (tree.array("candidate_position") - T[:3, 3]) @ T[:3, :3]
    return BinPlacement(
        **stored,
        rule=str(tree.attributes["rule"]),
        candidate_pose=np.column_stack([position, tree.array("candidate_yaw")]),
        **unpacked(tree),
        joint_names=tuple(tree.attributes["joint_names"]),
        **origin_of(tree, path),
        support=tree.text("support") if "support" in tree.leaves else None,
        **optional,
    )


_FILE = RecordFile(
    layout=PLACEMENT, to_tree=tree_from_placement, from_tree=placement_from_tree
)
write_placement, read_placement = _FILE.write, _FILE.read
