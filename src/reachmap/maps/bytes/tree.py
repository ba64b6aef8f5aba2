"""An artefact in memory, before it is a file: named values, and their checksums.

Nothing here knows HDF5. Contract checks and the conversion to records work on this
form; :mod:`reachmap.maps.bytes.hdf5` turns it into bytes and back.

``content_sha256`` covers the scientific result and is the same for the same
inputs, seed and settings. ``integrity_sha256`` covers everything a file says, measured
times and provenance included. Both are taken over the logical content, not over the
bytes of the file, so that a repacked copy keeps them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from reachmap.maps.bytes.to_json import plain

Array = npt.NDArray[Any]

MEASURED_TIMES = ("planning_time", "planning_cpu_time", "simplification_time")
"""Variables that differ from run to run; outside ``content_sha256``."""

UNHASHED_GROUPS = ("run", "provenance")
"""Groups outside ``content_sha256``; what matters of them is in ``config_sha256``."""

CHECKSUMS = ("content_sha256", "integrity_sha256")


@dataclass(frozen=True, slots=True, kw_only=True)
class Leaf:
    """An array with named dimensions, or a text.

    Attributes
    ----------
    value : array or str
    dims : tuple of str
        One name per dimension; a coordinate array is named like its dimension.
    attributes : mapping
        Strings, numbers, or lists of either.
    is_hidden : bool
        Whether netCDF readers take the coordinate for a mere length and pass it over.
    """

    value: Array | str
    dims: tuple[str, ...] = ()
    attributes: Mapping[str, Any] = field(default_factory=dict)
    is_hidden: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Tree:
    """Everything an artefact holds.

    Attributes
    ----------
    attributes : mapping
        Of the root.
    groups : mapping of str to mapping
        Path of each group ("cubes/right") to its attributes.
    leaves : mapping of str to Leaf
        Path of each array or text ("cubes/right/status") to what it holds.
    """

    attributes: dict[str, Any] = field(default_factory=dict)
    groups: dict[str, dict[str, Any]] = field(default_factory=dict)
    leaves: dict[str, Leaf] = field(default_factory=dict)

    def array(self, path: str) -> Array:
        """Return the array at a path; a text there is a mistake of the caller."""
        value = self.leaves[path].value
        if isinstance(value, str):
            raise TypeError(f"{path} is a text")
        return value

    def text(self, path: str) -> str:
        """Return the text at a path, or "" where there is none."""
        leaf = self.leaves.get(path)
        return leaf.value if leaf is not None and isinstance(leaf.value, str) else ""

    def cubes(self) -> list[str]:
        """Names of the cubes of a workspace map, in order."""
        return [
            name
            for group, _, name in (path.rpartition("/") for path in self.groups)
            if group == "cubes"
        ]

    def arrays(self) -> Iterator[tuple[str, Leaf, Array]]:
        """Path, leaf and value of every array."""
        for path, leaf in self.leaves.items():
            if not isinstance(leaf.value, str):
                yield path, leaf, leaf.value


def content_sha256(tree: Tree) -> str:
    """Hash of the arrays, their names, dimensions and types, and root attributes.

    Left out are the measured times, ``/run``, ``/provenance``, the attributes of
    variables, and the two checksums themselves.
    """
    digest = hashlib.sha256()
    _add_attributes(digest, "", tree.attributes)
    for path in sorted(tree.leaves):
        group, _, name = path.rpartition("/")
        if group.split("/")[0] not in UNHASHED_GROUPS and name not in MEASURED_TIMES:
            _add_leaf(digest, path, tree.leaves[path])
    return digest.hexdigest()


def integrity_sha256(tree: Tree) -> str:
    """Hash of everything but itself: times, run, provenance, all attributes."""
    digest = hashlib.sha256()
    digest.update(str(tree.attributes.get("content_sha256", "")).encode())
    _add_attributes(digest, "", tree.attributes)
    for path in sorted(tree.groups):
        _add_attributes(digest, path, tree.groups[path])
    for path in sorted(tree.leaves):
        _add_attributes(digest, path, tree.leaves[path].attributes)
        _add_leaf(digest, path, tree.leaves[path])
    return digest.hexdigest()


def _add_attributes(digest: Any, path: str, attributes: Mapping[str, Any]) -> None:
    kept = {k: plain(v) for k, v in attributes.items() if k not in CHECKSUMS}
    # NaN is allowed in attributes: it has one spelling here.
    text = json.dumps(kept, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    digest.update(f"attributes {json.dumps(path)} {text}\n".encode())


def _add_leaf(digest: Any, path: str, leaf: Leaf) -> None:
    if isinstance(leaf.value, str):
        data = leaf.value.encode()
        digest.update(f"text {json.dumps(path)} {len(data)}\n".encode())
        digest.update(data)
        return
    if leaf.value.dtype.kind == "U":
        data = json.dumps([path, list(leaf.dims), leaf.value.tolist()]).encode()
        digest.update(b"texts " + data + b"\n")
        return
    array = canonical_array(leaf.value)
    header = json.dumps([path, list(leaf.dims), array.dtype.str, list(array.shape)])
    digest.update(f"array {header}\n".encode())
    digest.update(array.data.cast("B") if array.size else b"")


def canonical_array(array: Array) -> Array:
    """Give numbers one bit pattern: little-endian, C order, one NaN, no -0."""
    little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    if little.dtype.kind != "f":
        return little
    positive = little + little.dtype.type(0.0)
    positive[np.isnan(positive)] = np.nan
    return np.asarray(positive)
