"""The cubes of a workspace map joined into one lattice."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reachmap._typing import FloatArray
from reachmap.maps.records import CubeMap, WorkspaceMap
from reachmap.sampling.lattice import Lattice, Stitching, pooled_percent, stitch

KINDS = ("path", "ik", "ik_free")
"""Kinds of reachability: with a path, with a solution, with a solution that is free."""


def stitch_cubes(cubes: Mapping[str, CubeMap]) -> Stitching:
    """Join the lattices of the cubes; points are matched by position."""
    return stitch([Lattice(x=cube.x, y=cube.y, z=cube.z) for cube in cubes.values()])


def pooled_reachability(
    cubes: Mapping[str, CubeMap], stitching: Stitching, kind: str
) -> FloatArray:
    """Eq. (1) over the frames of all cubes [percent], shape (nz, ny, nx)."""
    counts = [cube.counts(kind) for cube in cubes.values()]
    hits, attempts = zip(*counts, strict=True)
    return pooled_percent(stitching, hits, attempts)


def workspace_map_from_cubes(cubes: Mapping[str, CubeMap], **rest: Any) -> WorkspaceMap:
    """Build the record of a workspace map from its cubes.

    Parameters
    ----------
    cubes : mapping of str to CubeMap
    **rest
        The other fields of :class:`WorkspaceMap`; lattice and percentages are computed.
    """
    stitching = stitch_cubes(cubes)
    lattice = stitching.lattice
    path, ik, ik_free = (pooled_reachability(cubes, stitching, k) for k in KINDS)
    return WorkspaceMap(
        cubes=dict(cubes),
        x=lattice.x,
        y=lattice.y,
        z=lattice.z,
        path_reachability=path,
        ik_reachability=ik,
        ik_free_reachability=ik_free,
        **rest,
    )
