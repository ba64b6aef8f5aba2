"""A workspace map whose levels rise, whatever way the frame of its lattice points."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.errors import SettingsError
from reachmap.maps.records import CubeMap, WorkspaceMap, workspace_map_from_cubes

_LATTICE = ("x", "y", "z")
_STITCHED = (
    *_LATTICE, "cubes", "path_reachability", "ik_reachability", "ik_free_reachability",
)  # fmt: skip
# Rounding of a quarter turn.
WHOLE = 1e-9


def upright_workspace(record: WorkspaceMap, T_base_level: FloatArray) -> WorkspaceMap:
    """The same map with its lattice in an upright frame; z is a height there.

    Coordinates are swapped and mirrored, numbers stay. Tool orientations are left in
    robot_base.

    Parameters
    ----------
    record : WorkspaceMap
    T_base_level : array, shape (4, 4)
        The upright frame, see :meth:`reachmap.cell.model.cell.Cell.T_base_level`.

    Raises
    ------
    SettingsError
        The lattice leans, so no axes of its own are upright.
    """
    turn = T_base_level[:3, :3].T @ record.T_base_grid[:3, :3]
    if np.array_equal(turn, np.eye(3)):
        return record
    if np.abs(turn - np.round(turn)).max() > WHOLE:
        raise SettingsError(
            "the levels of this workspace map are not horizontal, as robot_base leans; "
            "scan with workspace_scan.frame: world"
        )
    axis, sign = np.abs(turn).argmax(axis=1), np.round(turn.sum(axis=1))
    cubes = {name: _turned(cube, axis, sign) for name, cube in record.cubes.items()}
    rest = {
        item.name: getattr(record, item.name)
        for item in dataclasses.fields(record)
        if item.name not in _STITCHED
    }
    return workspace_map_from_cubes(cubes, **{**rest, "T_base_grid": T_base_level})


def name_of_frame(T_base_frame: FloatArray, T_world_base: FloatArray | None) -> str:
    """Name of the frame that a map's lattice, or a bin's place, is given in.

    Parameters
    ----------
    T_base_frame : array, shape (4, 4)
    T_world_base : array, shape (4, 4), or None
        None: robot_base is the world.
    """
    if np.allclose(T_base_frame, np.eye(4), rtol=0.0, atol=WHOLE):
        return "robot_base"
    T_world_base = np.eye(4) if T_world_base is None else T_world_base
    if np.allclose(T_world_base @ T_base_frame, np.eye(4), rtol=0.0, atol=WHOLE):
        return "world"
    return "robot_base, upright"


def _turned(cube: CubeMap, axis: IntArray, sign: FloatArray) -> CubeMap:
    """A cube whose k-th coordinate is ``sign[k]`` times its old ``axis[k]``-th."""
    old = [getattr(cube, name) for name in _LATTICE]
    backwards = [k for k in range(3) if sign[k] < 0]
    changed: dict[str, Any] = {
        name: np.sort(sign[k] * old[axis[k]]) + 0.0 for k, name in enumerate(_LATTICE)
    }
    # Arrays are indexed (z, y, x), the coordinates backwards.
    order = [2 - int(axis[2 - place]) for place in range(3)]
    for item in dataclasses.fields(cube):
        values = getattr(cube, item.name)
        if item.name in (*_LATTICE, "quaternion_wxyz") or values is None:
            continue
        moved = values.transpose(*order, *range(3, values.ndim))
        changed[item.name] = np.flip(moved, tuple(2 - k for k in backwards)).copy()
    return dataclasses.replace(cube, **changed)
