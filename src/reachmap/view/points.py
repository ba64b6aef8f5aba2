"""The points of a map, and the test frames at each, to be shown and clicked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.geometry import transform_points
from reachmap.maps.format.registry import Artefact
from reachmap.maps.parts import freeze
from reachmap.maps.records import BinMap, BinPlacement, CubeMap, Status, WorkspaceMap
from reachmap.maps.summary.statistics import STATUS_NAMES
from reachmap.plots.parts.levels import level_names

EVERYTHING = "all points"


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """Test frames, those of one point after another.

    Attributes
    ----------
    point : int array, shape (m,)
        Point that each frame belongs to, rising.
    status, pair : array, shape (m,)
    quaternion_wxyz : array, shape (m, 4)
        TCP orientation in robot_base.
    goal : array, shape (m, dof)
        Stored goal configuration [rad], NaN where there is none.
    path : int array, shape (m,)
        Row of the shortest stored path, -1 where there is none.
    solved, free : array of bool, shape (m,)
        Whether there is an IK solution, and one without collision.
    """

    point: IntArray
    status: CodeArray
    pair: IntArray
    quaternion_wxyz: FloatArray
    goal: FloatArray
    path: IntArray
    solved: BoolArray
    free: BoolArray

    def __post_init__(self) -> None:
        freeze(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class MapPoints:
    """Points in robot_base, with their levels, percentages and test frames.

    Attributes
    ----------
    position : array, shape (n, 3)
        [m].
    level : int array, shape (n,)
        Index into ``levels``.
    levels : tuple of str
        Heights in words.
    shares : mapping of str to array, shape (n,)
        Percentages by name, NaN where nothing was attempted; the first is the main one.
    frames : Frames or None
        None for the candidates of a placement.
    size_m : float
        Radius that leaves room between neighbours.
    """

    position: FloatArray
    level: IntArray
    levels: tuple[str, ...]
    shares: Mapping[str, FloatArray]
    frames: Frames | None = None
    size_m: float = field(default=0.01)

    def __post_init__(self) -> None:
        freeze(self)

    def frames_at(self, point: int) -> IntArray:
        """Rows of the test frames at a point."""
        if self.frames is None:
            return np.zeros(0, np.int64)
        return np.flatnonzero(self.frames.point == point)

    def states(self) -> dict[str, Status]:
        """States that occur, by their names in words."""
        if self.frames is None:
            return {}
        found = set(np.unique(self.frames.status).tolist())
        return {name: code for code, name in STATUS_NAMES.items() if code in found}

    def chosen(self, level: int | None, state: str = EVERYTHING) -> IntArray:
        """Points on a level (None for all) with a test frame in a state."""
        mask = np.ones(len(self.position), bool)
        if level is not None:
            mask &= self.level == level
        if state != EVERYTHING and self.frames is not None:
            code = self.states()[state]
            with_state = self.frames.point[self.frames.status == code]
            mask &= np.isin(np.arange(len(mask)), with_state)
        return np.flatnonzero(mask)

    @property
    def main(self) -> FloatArray:
        """The percentage that matters most, shape (n,)."""
        return next(iter(self.shares.values()))


def points_of(record: Artefact | None) -> MapPoints:
    """Points of any artefact; none for a cell alone."""
    if record is None:
        nothing = np.zeros(0)
        return MapPoints(
            position=np.zeros((0, 3)),
            level=np.zeros(0, np.int64),
            levels=("no map",),
            shares={"path reachability": nothing},
        )
    if isinstance(record, WorkspaceMap):
        return _workspace_points(record)
    if isinstance(record, BinMap):
        return _bin_points(record)
    return _placement_points(record)


def _workspace_points(record: WorkspaceMap) -> MapPoints:
    cubes = tuple(record.cubes.values())
    where = []
    for cube in cubes:
        grid = np.meshgrid(cube.z, cube.y, cube.x, indexing="ij")
        where.append(np.stack(grid[::-1], axis=-1).reshape(-1, 3))
    # Points that cubes share become one; rounding joins 0.3 and 0.30000000000000004.
    position, point = np.unique(
        np.concatenate(where).round(9)[:, ::-1], axis=0, return_inverse=True
    )
    point = point.ravel()
    position = position[:, ::-1]
    own = np.split(point, np.cumsum([len(w) for w in where])[:-1])
    frames = _frames_of_cubes(cubes, own)
    z, level = np.unique(position[:, 2], return_inverse=True)
    return MapPoints(
        position=transform_points(record.T_base_grid, position),
        level=level.ravel(),
        levels=tuple(f"z = {name} m" for name in level_names(z)),
        shares=_shares(frames, len(position)),
        frames=frames,
        size_m=0.16 * _spacing(position),
    )


def _frames_of_cubes(cubes: Sequence[CubeMap], points: Sequence[IntArray]) -> Frames:
    """Test frames of all cubes, sorted by the number of their point."""
    owner = np.concatenate(
        [
            np.repeat(own, cube.status.shape[-1])
            for own, cube in zip(points, cubes, strict=True)
        ]
    )
    order = np.argsort(owner, kind="stable")

    def all_of(name: str) -> FloatArray:
        return np.concatenate([getattr(cube, name).ravel() for cube in cubes])[order]

    turns = [
        np.broadcast_to(cube.quaternion_wxyz, (*cube.status.shape, 4)).reshape(-1, 4)
        for cube in cubes
    ]
    goals = [cube.goal_configuration.reshape(cube.status.size, -1) for cube in cubes]
    return Frames(
        point=owner[order],
        status=all_of("status").astype(np.uint8),
        pair=all_of("blocking_pair").astype(np.int64),
        quaternion_wxyz=np.concatenate(turns)[order],
        goal=np.concatenate(goals)[order],
        path=np.full(len(order), -1, np.int64),
        solved=all_of("n_ik") > 0,
        free=all_of("n_ik_free") > 0,
    )


def _bin_points(record: BinMap) -> MapPoints:
    position = record.position.reshape(-1, 3)
    orientations = record.status.shape[-1]
    frames = Frames(
        point=np.repeat(np.arange(len(position)), orientations),
        status=record.status.ravel(),
        pair=record.blocking_pair.ravel().astype(np.int64),
        quaternion_wxyz=record.quaternion_wxyz.reshape(-1, 4),
        goal=record.goal_configuration.reshape(record.status.size, -1),
        path=shortest_paths(record).ravel(),
        solved=record.n_ik.ravel() > 0,
        free=record.n_ik_free.ravel() > 0,
    )
    names = level_names(record.layer)
    return MapPoints(
        position=position,
        level=np.repeat(np.arange(len(record.layer)), record.y.size * record.x.size),
        levels=tuple(f"{name} m above the bottom" for name in names),
        shares=_shares(frames, len(position)),
        frames=frames,
        size_m=0.26 * _step(record.x, record.y),
    )


def _placement_points(record: BinPlacement) -> MapPoints:
    position, place = np.unique(
        record.candidate_pose[:, :3].round(6), axis=0, return_inverse=True
    )
    best = np.full(len(position), np.nan)
    np.fmax.at(best, place.ravel(), record.score)
    z, level = np.unique(position[:, 2], return_inverse=True)
    return MapPoints(
        position=transform_points(record.T_base_level, position),
        level=level.ravel(),
        levels=tuple(f"z = {name} m" for name in level_names(z)),
        shares={"score": best},
        size_m=0.25 * _spacing(position),
    )


def shortest_paths(record: BinMap) -> IntArray:
    """Row of the shortest stored path of each test grasp, shape (nl, ny, nx, no)."""
    if record.best is not None:
        return record.best.row
    rows = np.full(record.status.shape, -1, np.int64)
    index = record.paths.index
    length = record.path_length[tuple(index.T)]
    # From the longest to the shortest: what is written last stays.
    order = np.argsort(-length, kind="stable")
    rows[tuple(index[order, :4].T)] = order
    return rows


def _shares(frames: Frames, count: int) -> dict[str, FloatArray]:
    tried = frames.status != Status.NOT_ATTEMPTED
    total = np.bincount(frames.point[tried], minlength=count).astype(float)
    masks = {
        "path reachability": frames.status == Status.PATH_FOUND,
        "collision-free IK": frames.free,
        "IK": frames.solved,
    }
    shares = {}
    for name, mask in masks.items():
        hits = np.bincount(frames.point[mask & tried], minlength=count)
        share = np.full(count, np.nan)
        np.divide(100.0 * hits, total, out=share, where=total > 0)
        shares[name] = share
    return shares


def _spacing(position: FloatArray) -> float:
    """Usual distance between neighbours on a lattice along the axes [m]."""
    return _step(*(np.unique(position[:, axis].round(4)) for axis in range(3)))


def _step(*axes: FloatArray) -> float:
    """Smallest usual step along rising coordinates [m], 0.012 to 0.15."""
    usual = [float(np.median(np.diff(values))) for values in axes if len(values) > 1]
    return float(np.clip(min(usual, default=0.05), 0.012, 0.15))
