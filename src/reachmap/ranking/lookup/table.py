"""The bin map as the look-up table of ranking."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.errors import MapFileError
from reachmap.geometry import (
    axis_vector,
    direction_angle,
    inverse_transform,
    rotation_from_quaternion_wxyz,
    transform_points,
)
from reachmap.maps.bytes.tree import canonical_array
from reachmap.maps.parts import freeze
from reachmap.maps.records import BinMap, Status
from reachmap.ranking.lookup.settings import QUANTILE, CostBasis
from reachmap.ranking.terms import (
    CycleSeconds,
    cycle_seconds,
    margin_terms,
    margin_values,
)

TERMS: Final = ("path_length", "planning_time", "execution_time")
# Rounding of directions that are meant to be equal.
SAME_AXIS_RAD: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspTable:
    """Test grasps by point and orientation, with the means that J is computed from.

    Points are numbered in the order (layer, y, x); n points, m orientations.

    Attributes
    ----------
    shape : (int, int, int, int)
        Layers, rows (y), columns (x), orientations.
    points : array, shape (n, 3)
        d_test in robot_base [m].
    quaternions : array, shape (n, m, 4)
        R_test in robot_base, wxyz.
    recommended : array, shape (n, m, 4)
        The tool orientation of the best path: R_test, turned by the roll that won
        where the roll is free.
    axes : array, shape (n, m, 3)
        Approach directions in robot_base.
    status : uint8 array, shape (n, m)
        Codes of :class:`Status`. ``path_found`` here means that a path is stored.
    blocking_pair : int array, shape (n, m)
    reachable : bool array, shape (n, m)
    means : array, shape (n, m, 3)
        Mean path length [rad], planning time and execution time [s] over the
        successful attempts; where none was, of the roadmap's own path; NaN where there
        is no path.
    maxima : array, shape (3,)
        Greatest of each mean over the path-reachable test grasps.
    scale : array, shape (3,)
        What each mean is divided by; 1 where the mean is zero everywhere.
    normalised : array, shape (n, m, 3)
        φ3, φ4, φ5: means over scale; NaN where unreachable.
    margins : array, shape (n, m, 4), or None
        Terms in the order of ``MARGINS``, normalised; None for a map without them.
    cycle : CycleSeconds or None
        What whole picks take; None for a map without cycles.
    basis : CostBasis
        With the planning time that was used, whatever was asked for.
    same_everywhere : bool
        Whether every point has the same orientations, as families give them.
    layers_m : array, shape (nl,)
        Heights in the bin frame [m].
    bin_points : array, shape (n, 3)
        The points in the bin frame [m].
    pitch_m : array, shape (2,)
        Spacing of the grid along the bin's x and y [m].
    spacing_rad : array, shape (2,)
        Greatest angle from an orientation to its nearest other: of approach axes,
        of whole orientations.
    T_bin_base, T_base_bin : array, shape (4, 4)
    approach_axis : str
    """

    shape: tuple[int, int, int, int]
    points: FloatArray
    quaternions: FloatArray
    recommended: FloatArray
    axes: FloatArray
    status: CodeArray
    blocking_pair: IntArray
    reachable: BoolArray
    means: FloatArray
    maxima: FloatArray
    scale: FloatArray
    normalised: FloatArray
    margins: FloatArray | None
    cycle: CycleSeconds | None
    basis: CostBasis
    same_everywhere: bool
    layers_m: FloatArray
    bin_points: FloatArray
    pitch_m: FloatArray
    spacing_rad: FloatArray
    T_bin_base: FloatArray
    T_base_bin: FloatArray
    approach_axis: str

    def __post_init__(self) -> None:
        freeze(self)

    def distinct(self, orientations: FloatArray) -> FloatArray:
        """Orientations (n, m, k) of the points; (1, m, k) where all have the same."""
        return orientations[:1] if self.same_everywhere else orientations

    def sha256(self) -> str:
        """Hash of the costs: equal hashes rank every list alike."""
        digest = hashlib.sha256()
        for values in (
            self.points,
            self.quaternions,
            self.status,
            self.reachable,
            self.normalised,
            np.zeros(0) if self.margins is None else self.margins,
            np.zeros(0) if self.cycle is None else self.cycle.values,
        ):
            digest.update(canonical_array(values).tobytes())
        return digest.hexdigest()


def table_from_bin_map(bin_map: BinMap, basis: CostBasis | None = None) -> GraspTable:
    """Arrange a bin map for ranking.

    Raises
    ------
    MapFileError
        The map has no test grasps, or its poses are not finite.
    """
    nl, ny, nx, no = shape = bin_map.status.shape
    n = nl * ny * nx
    if 0 in shape:
        raise MapFileError(f"the bin map has no test grasps (shape {shape})")
    points = bin_map.position.reshape(n, 3)
    quaternions = _unit_quaternions(bin_map.quaternion_wxyz.reshape(n, no, 4))
    if not (np.isfinite(points).all() and np.isfinite(bin_map.bin_pose).all()):
        raise MapFileError("the bin map has poses that are not finite")
    basis = _possible(basis or CostBasis(), bin_map)
    means = _means(bin_map, basis).reshape(n, no, 3)
    reachable: BoolArray = np.isfinite(means[..., 0])
    maxima = np.max(means, axis=(0, 1), where=reachable[..., None], initial=0.0)
    scale = _scale(means[reachable], maxima, basis)
    status = _status(bin_map.status.reshape(n, no), reachable)
    R = rotation_from_quaternion_wxyz(quaternions)
    axes = R @ axis_vector(bin_map.approach_axis)
    T_bin_base = inverse_transform(bin_map.bin_pose)
    return GraspTable(
        shape=(nl, ny, nx, no),
        points=points.copy(),
        quaternions=quaternions,
        recommended=_recommended(bin_map, quaternions),
        axes=axes,
        status=status,
        blocking_pair=bin_map.blocking_pair.reshape(n, no).copy(),
        reachable=reachable,
        means=means,
        maxima=maxima,
        scale=scale,
        normalised=means / scale,
        margins=_margins(bin_map, reachable, basis),
        cycle=cycle_seconds(bin_map, status),
        basis=basis,
        same_everywhere=bool(
            (quaternion_angle(quaternions, quaternions[0]) < 1e-9).all()
        ),
        layers_m=bin_map.layer.copy(),
        bin_points=transform_points(T_bin_base, points),
        pitch_m=_pitch(bin_map),
        spacing_rad=np.array(
            [_spacing(axes, direction_angle), _spacing(quaternions, quaternion_angle)]
        ),
        T_bin_base=T_bin_base,
        T_base_bin=bin_map.bin_pose.copy(),
        approach_axis=bin_map.approach_axis,
    )


def _unit_quaternions(quaternions: FloatArray) -> FloatArray:
    norm = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    if not (np.abs(norm - 1.0) < 1e-6).all():
        raise MapFileError("the bin map has quaternions that are not of unit length")
    return np.asarray(quaternions / norm)


def _recommended(bin_map: BinMap, quaternions: FloatArray) -> FloatArray:
    """R_test rolled about the approach axis by what the best path takes."""
    if bin_map.winning_roll is None:
        return quaternions
    half = 0.5 * np.nan_to_num(bin_map.winning_roll).reshape(quaternions.shape[:-1])
    axis = axis_vector(bin_map.approach_axis)
    w, v = quaternions[..., :1], quaternions[..., 1:]
    c, s = np.cos(half)[..., None], np.sin(half)[..., None] * axis
    turned = np.concatenate(
        [
            w * c - (v * s).sum(axis=-1, keepdims=True),
            w * s + c * v + np.cross(v, s),
        ],
        axis=-1,
    )
    return turned * np.where(turned[..., :1] < 0, -1.0, 1.0)


def _possible(basis: CostBasis, bin_map: BinMap) -> CostBasis:
    """The basis, with measured times where the map has no counts of checks."""
    if bin_map.effort is None and basis.planning_time == "checks":
        return replace(basis, planning_time="measured")
    return basis


def _means(bin_map: BinMap, basis: CostBasis) -> FloatArray:
    """Means over successful attempts, shape (..., 3); NaN where there is no path."""
    found = bin_map.path_found > 0
    values = (
        bin_map.path_length,
        _planning_time(bin_map, basis),
        bin_map.execution_time,
    )
    stacked = np.stack(values, axis=-1)
    count = found.sum(axis=-1)[..., None]
    total = np.where(found[..., None], stacked, 0.0).sum(axis=-2)
    if not np.isfinite(total).all():
        raise MapFileError("the bin map has a path without length or times")
    means = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return np.where(count > 0, means, _of_best_paths(bin_map))


def _planning_time(bin_map: BinMap, basis: CostBasis) -> FloatArray:
    """Planning time of each attempt as a basis has it [s], shape of ``path_found``."""
    if bin_map.effort is None or basis.planning_time == "measured":
        return bin_map.planning_cpu_time
    return np.asarray(bin_map.effort.checks * bin_map.effort.seconds_per_check)


def _of_best_paths(bin_map: BinMap) -> FloatArray:
    """What the best paths take, shape (..., 3).

    The roadmap's own path took no planner; its checks stand for its time, measured
    times or not.
    """
    best, effort = bin_map.best, bin_map.effort
    if best is None or effort is None:
        return np.full((*bin_map.status.shape, 3), np.nan)
    planning = best.effort_checks * effort.seconds_per_check
    values = np.stack([best.path_length, planning, best.execution_time], axis=-1)
    return np.where(best.row[..., None] >= 0, values, np.nan)


def _margins(
    bin_map: BinMap, reachable: BoolArray, basis: CostBasis
) -> FloatArray | None:
    values = margin_values(bin_map)
    if values is None:
        return None
    return margin_terms(
        values.reshape(*reachable.shape, -1),
        reachable,
        lambda known, maxima: _scale(known, maxima, basis),
    )


def _scale(means: FloatArray, maxima: FloatArray, basis: CostBasis) -> FloatArray:
    """Divisors that normalise values (reachable, k), shape (k,)."""
    scale: FloatArray = maxima
    if basis.normalise == "quantile" and len(means):
        quantile = np.quantile(means, QUANTILE, axis=0)
        # Where nearly all are zero, the quantile says nothing.
        scale = np.where(quantile > 0, quantile, maxima)
    # A term that is zero everywhere costs nothing rather than 0/0.
    return np.asarray(np.where(scale > 0, scale, 1.0), float)


def _status(status: CodeArray, reachable: BoolArray) -> CodeArray:
    """Status as ranking sees it: where a path is stored.

    In maps of version 1.0 the roadmap proves some test grasps reachable whose path is
    not stored; they have no cost, and are ``no_path_found`` for a picking loop.
    """
    unmeasured = (status == Status.PATH_FOUND) & ~reachable
    seen = np.where(unmeasured, Status.NO_PATH_FOUND, status)
    return np.asarray(np.where(reachable, Status.PATH_FOUND, seen).astype(np.uint8))


def _pitch(bin_map: BinMap) -> FloatArray:
    """Spacing along x and y; a single row stands for the whole inner side."""
    sides = zip((bin_map.x, bin_map.y), bin_map.bin_inner[:2], strict=True)
    return np.array([np.diff(c).max() if c.size > 1 else side for c, side in sides])


def _spacing(
    orientations: FloatArray, angle: Callable[[FloatArray, FloatArray], FloatArray]
) -> float:
    """Greatest angle from an orientation of the first point to its nearest other."""
    angles = angle(orientations[0][:, None], orientations[0][None])
    others = np.where(angles > SAME_AXIS_RAD, angles, np.inf).min(axis=1)
    gap = float(others.max())
    return gap if np.isfinite(gap) else float(np.pi)


def quaternion_angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Rotation angle between unit quaternions [rad]: φ2 of Eq. (3).

    Equal to :func:`reachmap.geometry.rotation_angle` of the matrices, for half the
    arithmetic; the half-angle form keeps full precision near 0 and near π.

    Parameters
    ----------
    a, b : array, shape (..., 4)

    Returns
    -------
    array, shape (...)
        In [0, π].
    """
    # q and -q are the same rotation: the nearer of the two counts.
    chord = np.linalg.norm(a - b, axis=-1)
    total = np.linalg.norm(a + b, axis=-1)
    return np.asarray(4.0 * np.arctan2(np.minimum(chord, total),
                                       np.maximum(chord, total)))  # fmt: skip
