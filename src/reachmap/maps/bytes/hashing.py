"""Checksums of an artefact: its content, its inputs, everything in it, its bytes.

``content_sha256`` covers the scientific result and is the same for the same
inputs, seed and settings. ``integrity_sha256`` covers everything a file says, measured
times and provenance included. Both are taken over the logical content, not over the
bytes of the file, so that a repacked copy keeps them.

The seal is a checksum of the bytes, appended to the HDF5 data. The HDF5 library trusts
what it reads: on a file with a few flipped bits it can loop for ever. So no artefact is
handed to it before its bytes have been compared with the seal. Readers of HDF5 ignore
what follows the end of the file that the superblock names; a program that opens the
file for writing cuts the seal off.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from reachmap.maps.bytes.to_json import plain
from reachmap.maps.bytes.tree import Array, Leaf, Tree

MEASURED_TIMES = ("planning_time", "planning_cpu_time", "simplification_time")
"""Variables that differ from run to run; outside ``content_sha256``."""

UNHASHED_GROUPS = ("run", "provenance")
"""Groups outside ``content_sha256``; what matters of them is in ``config_sha256``."""

CHECKSUMS = ("content_sha256", "integrity_sha256")

_PREFIX = b"\nreachmap-seal sha256 "
_PATTERN = re.compile(re.escape(_PREFIX) + rb"([0-9a-f]{64})\n\Z")
SEAL_BYTES = len(_PREFIX) + 65


def canonical_json(value: Any) -> str:
    """Write a value as the one JSON text for it: keys sorted, no spaces, no NaN.

    Examples
    --------
    >>> canonical_json({"b": (1, 2.5), "a": "é"})
    '{"a":"é","b":[1,2.5]}'
    """
    return json.dumps(
        plain(value),
        sort_keys=True,
        separators=(",", ":"),
        ensure_ascii=False,
        allow_nan=False,
    )


def config_sha256(
    *,
    kind: str,
    cell_sha256: str,
    seed: int,
    settings: Mapping[str, Any],
    method: str = "",
    source_sha256: str = "",
) -> str:
    """Hash of everything that determines a result.

    Parameters
    ----------
    kind : str
        What is made, as in ``"bin_map"``.
    cell_sha256 : str
        Of the cell's contents, not of paths on one machine.
    seed : int
    settings : mapping
        Whatever else the result depends on: repeats, planner, checking. Never the
        number of workers, names of files or limits on time.
    method : str
    source_sha256 : str
        ``content_sha256`` of the artefact this one is made from.
    """
    facts = {
        "kind": kind,
        "cell_sha256": cell_sha256,
        "seed": seed,
        "settings": settings,
        "method": method,
        "source_sha256": source_sha256,
    }
    return hashlib.sha256(canonical_json(facts).encode()).hexdigest()


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


def seal(image: bytes) -> bytes:
    """Make the line that is written behind an HDF5 image."""
    return _PREFIX + hashlib.sha256(image).hexdigest().encode() + b"\n"


def unseal(data: bytes) -> tuple[bytes, bool | None]:
    """Split a file into its HDF5 image and the verdict of its seal.

    Returns
    -------
    image : bytes
    intact : bool or None
        Whether the seal fits the image; None where there is no seal.
    """
    found = _PATTERN.search(data, max(0, len(data) - SEAL_BYTES))
    if found is None:
        return data, None
    image = data[: found.start()]
    return image, hashlib.sha256(image).hexdigest().encode() == found.group(1)
