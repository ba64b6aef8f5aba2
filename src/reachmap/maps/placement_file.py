"""Bin placements: record to file and back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.maps.assembly import assemble
from reachmap.maps.placement_format import PLACEMENT
from reachmap.maps.records import BinPlacement
from reachmap.maps.stamps import provenance_of, run_of, stamp_of
from reachmap.maps.storage import load, store
from reachmap.maps.tree import Tree

_ARRAYS = (
    "bin_pose", "scan_configuration", "score", "worst_point", "reachable_share",
    "exact",
)  # fmt: skip
_ROWS = ("chosen", "runner_up", "paper_choice")


def write_placement(path: Path, record: BinPlacement, overwrite: bool = False) -> str:
    """Write a bin placement.

    Parameters
    ----------
    path : Path
    record : BinPlacement
        Its ``stamp.content_sha256`` is not used: it is computed from the numbers.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    str
        ``content_sha256``.

    Raises
    ------
    OutputError
        The file exists, or nothing can be written there.
    EngineError
        The record breaks the format.
    """
    return store(path, tree_from_placement(record), PLACEMENT, overwrite=overwrite)


def tree_from_placement(record: BinPlacement) -> Tree:
    """Everything that the file will hold."""
    reasons = ("", *sorted(set(record.reason) - {""}))
    shift = {k: v for k, v in record.margin.items() if not is_turn(k)}
    turn = {k: v for k, v in record.margin.items() if is_turn(k)}
    poses = np.reshape(record.candidate_pose, (-1, 4))
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _ARRAYS}
    arrays.update(
        candidate_position=poses[:, :3],
        candidate_yaw=poses[:, 3],
        reason=np.array([reasons.index(text) for text in record.reason], np.int64),
        shift_margin=np.array(list(shift.values()), float),
        turn_margin=np.array(list(turn.values()), float),
    )
    return assemble(
        PLACEMENT,
        arrays=arrays,
        attributes={
            **{name: int(getattr(record, name)) for name in _ROWS},
            "rule": record.rule,
        },
        labels={
            "joint_names": record.joint_names,
            "reasons": reasons,
            "shift_directions": tuple(shift),
            "turn_directions": tuple(turn),
        },
        stamp=record.stamp,
        provenance=record.provenance,
        run=record.run,
    )


def is_turn(direction: str) -> bool:
    """Whether a direction of the margin is an angle, as "+yaw" is."""
    return direction.lstrip("+-") in ("roll", "pitch", "yaw")


def read_placement(path: Path) -> BinPlacement:
    """Read a bin placement; everything about it is checked.

    Raises
    ------
    MapFileError
        The file is missing, damaged, or something else.
    """
    tree, _ = load(path, PLACEMENT)
    return placement_from_tree(tree, path)


def placement_from_tree(tree: Tree, path: Path) -> BinPlacement:
    """Turn a checked tree into a record; ``path`` is named in messages."""
    reasons = tree.attributes["reasons"]
    stored: dict[str, Any] = {name: tree.array(name) for name in _ARRAYS}
    stored.update({name: int(tree.attributes[name]) for name in _ROWS})
    position, yaw = tree.array("candidate_position"), tree.array("candidate_yaw")
    return BinPlacement(
        **stored,
        rule=str(tree.attributes["rule"]),
        candidate_pose=np.column_stack([position, yaw]),
        reason=tuple(str(reasons[code]) for code in tree.array("reason")),
        margin={**_margin(tree, "shift"), **_margin(tree, "turn")},
        joint_names=tuple(tree.attributes["joint_names"]),
        stamp=stamp_of(tree),
        provenance=provenance_of(tree, path),
        run=run_of(tree, path),
    )


def _margin(tree: Tree, name: str) -> Mapping[str, float]:
    directions = tree.leaves[name].attributes[f"{name}_directions"]
    values = tree.array(f"{name}_margin").tolist()
    return dict(zip(directions, values, strict=True))
