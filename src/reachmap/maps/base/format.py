"""Placements of the robot base: record to file and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from reachmap.maps.base.record import BasePlacement
from reachmap.maps.bytes.tree import Tree
from reachmap.maps.format.assembly import assemble, origin_of
from reachmap.maps.format.candidates import (
    REASON,
    margin_variables,
    of_candidate,
    packed,
    reason_problems,
    row_problems,
    unpacked,
)
from reachmap.maps.format.checks import check_pose, require
from reachmap.maps.format.layout import JOINT, PERCENT, SCAN, Layout, Variable, index
from reachmap.maps.format.store import RecordFile

PERCENTAGES: Final = {
    "score": "Mean path reachability of the bin; a bound where exact is 0.",
    "score_error": "Standard error of score, from the number of test grasps.",
    "worst_point": "Path reachability of the worst point of the pick volume.",
    "reachable_share": "Share of test grasps with inverse kinematics.",
}
OFF: Final = "How far the base may be off before the score drops 5 points."
POSES: Final = {
    "base_pose": "T_world_base of the chosen place.",
    "bin_pose": "T_world_bin, which stays.",
    "T_world_level": "Upright frame at the bin that the search was done in.",
}
_ROWS: Final = ("chosen", "runner_up", "present")
_ARRAYS: Final = (
    *POSES, "scan_configuration", "best_of", "arm", "mounting", "candidate_position",
    "candidate_yaw", *PERCENTAGES, "exact",
)  # fmt: skip


def check_base(tree: Tree) -> list[str]:
    """Check rows, reasons against missing scores, and bounds."""
    score = tree.array("score")
    problems = [
        *(text for name in POSES for text in check_pose(tree.array(name))),
        *reason_problems(tree),
        *require(
            np.isnan(score) | (score <= tree.array("reachable_share") + 1e-6),
            "score must not exceed reachable_share",
        ),
        *require(
            tree.array("best_of") < len(score), "best_of must be rows of the candidates"
        ),
    ]
    problems += row_problems(tree, {"chosen": 0, "runner_up": -1, "present": -1})
    if not problems:
        chosen = tree.attributes["chosen"]
        place = tree.array("candidate_position")[chosen]
        on_rail = bool(tree.attributes["rail"])
        if not on_rail and not np.allclose(
            place, tree.array("base_pose")[:3, 3], atol=1e-6
        ):
            problems.append("base_pose must be that of the chosen candidate")
        if not tree.array("exact")[chosen]:
            problems.append("the chosen candidate must be exact")
    return problems


BASE: Final = Layout(
    kind="base_placement",
    check=check_base,
    title="Where the arm goes in a robot cell",
    signal="score",
    axes=("candidate",),
    attributes={
        "chosen": "Row of the chosen candidate.",
        "runner_up": "Row of the best place elsewhere or of another arm; -1: none.",
        "present": "Row of the cell as it is, -1: none.",
        "rail": "Locked joint whose position is chosen, in place of a pose.",
        "joint_names": "Names of the joints of the chosen arm, in order.",
        "arms": "Arms that were compared.",
        "mountings": "Mountings that were compared.",
        "reasons": "Reasons for excluding a candidate; the first is the empty one.",
    },
    variables=(
        index("candidate", "Places that were considered."),
        JOINT,
        index("pose_row", "Rows of a homogeneous matrix."),
        index("pose_column", "Columns of a homogeneous matrix."),
        index("xyz", "Coordinates x, y, z."),
        index("arm_name", "Arms.", labels="arms"),
        index("mounting_name", "Mountings.", labels="mountings"),
        index("shift", "Directions of shift_margin.", labels="shift_directions"),
        index("turn", "Directions of turn_margin.", labels="turn_directions"),
        *(
            Variable(
                path=name,
                dims=("pose_row", "pose_column"),
                dtype="f8",
                units="m",
                meaning=f"{text} The rotation block has no unit.",
                frame="world",
            )
            for name, text in POSES.items()
        ),
        SCAN,
        Variable(
            path="best_of",
            dims=("arm_name", "mounting_name"),
            dtype="i4",
            units="1",
            meaning="Best candidate of each arm and mounting, -1: none.",
            low=-1,
        ),
        of_candidate("arm", "i4", "1", "Arm.", low=0, labels="arms", is_index=True),
        of_candidate(
            "mounting", "i4", "1", "Mounting.", low=0, labels="mountings", is_index=True
        ),
        Variable(
            path="candidate_position",
            dims=("candidate", "xyz"),
            dtype="f8",
            units="m",
            meaning="Place of robot_base; on a rail the joint's position, and zeros.",
            frame="world",
        ),
        of_candidate(
            "candidate_yaw",
            "f8",
            "rad",
            "Heading of the base about the vertical.",
            frame="world",
        ),
        *(
            of_candidate(name, "f8", meaning=meaning, nan=True, **PERCENT)
            for name, meaning in PERCENTAGES.items()
        ),
        of_candidate(
            "exact", "u1", "1", "1 where paths were planned, 0: a bound.", is_flag=True
        ),
        REASON,
        *margin_variables(OFF, OFF),
    ),
)


def tree_from_base(record: BasePlacement) -> Tree:
    """Everything that the file will hold."""
    of_reasons, labels = packed(record)
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _ARRAYS}
    rows = {name: int(getattr(record, name)) for name in _ROWS}
    return assemble(
        BASE,
        arrays=arrays | of_reasons,
        attributes={**rows, "rail": record.rail},
        labels={
            "joint_names": record.joint_names,
            "arms": record.arms,
            "mountings": record.mountings,
            **labels,
        },
        stamp=record.stamp,
        provenance=record.provenance,
        run=record.run,
    )


def base_from_tree(tree: Tree, path: Path) -> BasePlacement:
    """Turn a checked tree into a record; ``path`` is named in messages."""
    fields: dict[str, Any] = {name: tree.array(name) for name in _ARRAYS}
    fields |= {name: int(tree.attributes[name]) for name in _ROWS}
    fields |= {
        name: tuple(tree.attributes[name])
        for name in ("joint_names", "arms", "mountings")
    }
    return BasePlacement(
        **fields,
        rail=str(tree.attributes["rail"]),
        **unpacked(tree),
        **origin_of(tree, path),
    )


_FILE = RecordFile(layout=BASE, to_tree=tree_from_base, from_tree=base_from_tree)
write_base, read_base = _FILE.write, _FILE.read
