"""Trees of older minor versions in the words of today's."""

from __future__ import annotations

import dataclasses

import numpy as np

from reachmap.maps.bytes.tree import Leaf, Tree


def upgraded(tree: Tree) -> Tree:
    """A tree of version 1.0 as version 1.1 has it; any other as it is.

    Joints were counted instead of named, and the dimensions of cubes were called like
    those of the root. Nothing else changed its form.
    """
    if tree.attributes.get("format_version") != "1.0":
        return tree
    leaves = dict(tree.leaves)
    joint = leaves.get("joint")
    if joint is not None and joint.dims == ("joint",):
        names = np.array(joint.attributes.get("joint_names", ()), str)
        leaves["joint"] = dataclasses.replace(joint, value=names)
    for path, leaf in tree.leaves.items():
        if path.startswith("cubes/"):
            leaves.update(_renamed(path, leaf))
    return dataclasses.replace(tree, leaves=leaves)


def _renamed(path: str, leaf: Leaf) -> dict[str, Leaf]:
    dims = tuple(
        f"cube_{name}" if name in ("x", "y", "z") else name for name in leaf.dims
    )
    group, _, name = path.rpartition("/")
    if leaf.dims != (name,) or name == dims[0]:
        return {path: dataclasses.replace(leaf, dims=dims)}
    return {
        path: dataclasses.replace(leaf, is_hidden=True),
        f"{group}/cube_{name}": dataclasses.replace(leaf, dims=dims),
    }
