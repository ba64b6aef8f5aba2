"""An artefact in memory, before it is a file: named arrays, texts and attributes.

Nothing here knows HDF5. Checksums, contract checks and the conversion to records work
on this form; :mod:`reachmap.maps.bytes.hdf5` turns it into bytes and back.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy.typing as npt

Array = npt.NDArray[Any]


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
