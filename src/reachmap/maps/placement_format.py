"""The format ``reachmap.bin_placement``, version 1.0."""

from __future__ import annotations

from typing import Any

import numpy as np

from reachmap.maps.consistency import check_pose, require
from reachmap.maps.layout_parts import PERCENT, SCAN, index
from reachmap.maps.schema import Layout, Variable
from reachmap.maps.tree import Tree


def check_placement(tree: Tree) -> list[str]:
    """Check the chosen row against the pose, and reasons against missing scores."""
    score, reason = tree.array("score"), tree.array("reason")
    problems = check_pose(tree.array("bin_pose"))
    for name, least in (("chosen", 0), ("runner_up", -1), ("paper_choice", -1)):
        row = tree.attributes.get(name)
        if not isinstance(row, int) or not least <= row < len(score):
            problems.append(
                f"the root attribute {name} must be a row of the candidates"
            )
    problems += require(
        np.isnan(score) == (reason != 0),
        "reason must be given exactly where a candidate has no score",
    )
    if not problems:
        chosen = tree.array("candidate_position")[tree.attributes["chosen"]]
        if not np.allclose(chosen, tree.array("bin_pose")[:3, 3], atol=1e-6):
            problems.append("bin_pose must be the pose of the chosen candidate")
    return problems


def _per_candidate(
    name: str, dtype: str, units: str, meaning: str, **more: Any
) -> Variable:
    return Variable(
        path=name,
        dims=("candidate",),
        dtype=dtype,
        units=units,
        meaning=meaning,
        **more,
    )


PLACEMENT = Layout(
    kind="bin_placement",
    check=check_placement,
    name="bin placement",
    command="reachmap place-bin",
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
        index("joint", "Joints, in the order of joint_names.", labels="joint_names"),
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
        _per_candidate(
            "candidate_yaw",
            "f8",
            "rad",
            "Angle of the bin about z.",
            frame="robot_base",
        ),
        _per_candidate(
            "score",
            "f8",
            meaning="Mean path reachability over the pick volume; NaN: excluded.",
            nan=True,
            **PERCENT,
        ),
        _per_candidate(
            "worst_point",
            "f8",
            meaning="Path reachability of the worst point of the pick volume.",
            nan=True,
            **PERCENT,
        ),
        _per_candidate(
            "reachable_share",
            "f8",
            meaning="Share of test frames that can be reached.",
            nan=True,
            **PERCENT,
        ),
        _per_candidate(
            "exact",
            "u1",
            "1",
            "1 where the bin was in the scene, 0 where the map was interpolated.",
            is_flag=True,
        ),
        _per_candidate(
            "reason",
            "i4",
            "1",
            "Why the candidate is excluded, an index into reasons; 0: it is not.",
            low=0,
            labels="reasons",
            is_index=True,
        ),
        Variable(
            path="shift_margin",
            dims=("shift",),
            dtype="f8",
            units="m",
            meaning="How far the bin can be moved before the score drops by 5 points.",
            low=0.0,
        ),
        Variable(
            path="turn_margin",
            dims=("turn",),
            dtype="f8",
            units="rad",
            meaning="How far the bin can be turned before the score drops by 5 points.",
            low=0.0,
        ),
    ),
)
