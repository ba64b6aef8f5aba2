"""Robustness: record to file and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from reachmap.maps.bytes.tree import Tree
from reachmap.maps.format.assembly import assemble, origin_of
from reachmap.maps.format.checks import require
from reachmap.maps.format.layout import PERCENT, Layout, Variable, coordinate, index
from reachmap.maps.format.store import RecordFile
from reachmap.maps.robustness.record import CERTIFICATES, Robustness

_GRASP: Final = ("layer", "y", "x", "orientation")
_CELL: Final = ("scale", "sample")
_POSE: Final = (*_CELL, "pose_row", "pose_column")


def check_robustness(tree: Tree) -> list[str]:
    """Check proofs, counts and percentages against each other."""
    reached, kept = tree.array("reached") == 1, tree.array("kept")
    certified = tree.array("certificate") != 0
    samples = tree.array("reachability").shape[1]
    share = 100.0 / reached.size
    counted = kept.reshape(len(kept), -1).sum(axis=1) * share / samples
    proved = certified.reshape(len(kept), -1).sum(axis=1) * share
    mean = tree.array("reachability").mean(axis=1)
    return [
        *require(kept <= samples, "kept must not exceed the number of samples"),
        *require(reached | (kept == 0), "kept must be 0 where there is no path"),
        *require(
            ~certified | (kept == samples), "what is certified must stay reachable"
        ),
        *require(abs(counted - mean) < 1e-9, "reachability must follow from kept"),
        *require(
            abs(proved - tree.array("certified")) < 1e-9,
            "certified must follow from certificate",
        ),
    ]


ROBUSTNESS = Layout(
    kind="robustness",
    title="Test grasps that stay reachable when bin, camera or tool are off",
    signal="certified",
    axes=("scale",),
    check=check_robustness,
    attributes={
        "margin_m": "Clearance that a path must keep in a perturbed cell.",
        "body_pairs": "Names of two bodies each; closest_pair indexes this list.",
        "certificates": "What proves that a path stays free.",
    },
    variables=(
        Variable(
            path="scale",
            dims=("scale",),
            dtype="f8",
            units="1",
            meaning="Multiples of the errors in sizes.",
            low=0.0,
        ),
        index("sample", "Perturbed cells at each scale."),
        coordinate("layer", "Heights above the inner bottom.", "bin"),
        coordinate("y", "Rows of test points.", "bin"),
        coordinate("x", "Columns of test points.", "bin"),
        index("orientation", "Test grasps at a point."),
        index("pose_row", "Rows of a homogeneous matrix."),
        index("pose_column", "Columns of a homogeneous matrix."),
        index("source", "What is off: bin, camera, tool."),
        index("size_column", "Shift [m], turn [rad]."),
        Variable(
            path="sizes",
            dims=("source", "size_column"),
            dtype="f8",
            units="1",
            meaning="Shift [m] and turn [rad] of bin, camera and tool at scale 1.",
            low=0.0,
        ),
        Variable(
            path="certified",
            dims=("scale",),
            dtype="f8",
            meaning="Share of test grasps that are proved to stay reachable.",
            **PERCENT,
        ),
        Variable(
            path="reachability",
            dims=_CELL,
            dtype="f8",
            meaning="Share of test grasps whose path stays free in a perturbed cell.",
            **PERCENT,
        ),
        Variable(
            path="reached",
            dims=_GRASP,
            dtype="u1",
            units="1",
            meaning="1 where the bin map has a path.",
            is_flag=True,
        ),
        Variable(
            path="certificate",
            dims=("scale", *_GRASP),
            dtype="u1",
            units="1",
            meaning="What proves that the path stays free.",
            labels="certificates",
            is_index=True,
        ),
        Variable(
            path="kept",
            dims=("scale", *_GRASP),
            dtype="i4",
            units="1",
            meaning="Perturbed cells in which the path stays free.",
            low=0,
        ),
        Variable(
            path="closest_pair",
            dims=_GRASP,
            dtype="i4",
            units="1",
            meaning="Bodies that errors bring closest, an index into body_pairs; -1: "
            "not known.",
            low=-1,
            labels="body_pairs",
            is_index=True,
        ),
        Variable(
            path="bin_pose",
            dims=_POSE,
            dtype="f8",
            units="m",
            meaning="T_base_bin of a perturbed cell; the rotation block has no unit.",
            frame="robot_base",
        ),
        Variable(
            path="tool_pose",
            dims=_POSE,
            dtype="f8",
            units="m",
            meaning="Its tool in the frame of the mount; the identity: not off.",
            frame="tcp.parent",
        ),
    ),
)
_ARRAYS: Final = (
    "scale", "layer", "y", "x", "sizes", "certified", "reachability", "reached",
    "certificate", "kept", "closest_pair", "bin_pose", "tool_pose",
)  # fmt: skip


def tree_from_robustness(record: Robustness) -> Tree:
    """Everything that the file will hold."""
    return assemble(
        ROBUSTNESS,
        arrays={name: getattr(record, name) for name in _ARRAYS},
        attributes={"margin_m": float(record.margin_m)},
        labels={"body_pairs": record.body_pairs, "certificates": CERTIFICATES},
        stamp=record.stamp,
        provenance=record.provenance,
        run=record.run,
    )


def robustness_from_tree(tree: Tree, path: Path) -> Robustness:
    """Turn a checked tree into a record; ``path`` is named in messages."""
    fields: dict[str, Any] = {name: tree.array(name) for name in _ARRAYS}
    return Robustness(
        **fields,
        margin_m=float(np.float64(tree.attributes["margin_m"])),
        body_pairs=tuple(tree.attributes["body_pairs"]),
        **origin_of(tree, path),
    )


_FILE = RecordFile(
    layout=ROBUSTNESS, to_tree=tree_from_robustness, from_tree=robustness_from_tree
)
write_robustness, read_robustness = _FILE.write, _FILE.read
