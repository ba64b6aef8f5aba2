"""Ranking by look-up: Algorithm 1 of the paper, vectorised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray, IntArray
from reachmap.errors import SettingsError
from reachmap.geometry import quaternion_wxyz_from_rotation
from reachmap.maps.records import BinMap, freeze
from reachmap.ranking.approach import axis_vector, complete_rotation
from reachmap.ranking.costs import (
    blended_terms,
    grasp_costs,
    likeness_terms,
    outside_map,
)
from reachmap.ranking.matching import Matches, Queries, build_tree, match
from reachmap.ranking.settings import RankSettings, Roll
from reachmap.ranking.table import GraspTable, table_from_bin_map

OUTSIDE_MAP: Final = 254


@dataclass(frozen=True, slots=True, kw_only=True)
class Ranking:
    """The order of a list of grasps, and why. Rows are in supplied order.

    Attributes
    ----------
    order : int array, shape (n,)
        Supplied numbers of the grasps, best first; unreachable ones last in their
        supplied order.
    cost : array, shape (n,)
        J; inf where unreachable.
    terms : array, shape (n, 4)
        α φ3, β φ4, δ φ5, ε φ6, which add up to J; NaN where unreachable.
    status : uint8 array, shape (n,)
        :class:`reachmap.maps.records.Status` of the test grasp, or ``OUTSIDE_MAP``.
    test_grasp : int array, shape (n, 4)
        Layer, y, x, orientation of the nearest test grasp.
    distance : array, shape (n,)
        φ1 [m].
    angle : array, shape (n,)
        φ2 [rad]; between approach axes where the roll is free.
    roll_free : bool array, shape (n,)
    orientation_wxyz : array, shape (n, 4)
        R_test of the test grasp in robot_base: the tool orientation to use.
    """

    order: IntArray
    cost: FloatArray
    terms: FloatArray
    status: CodeArray
    test_grasp: IntArray
    distance: FloatArray
    angle: FloatArray
    roll_free: BoolArray
    orientation_wxyz: FloatArray

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def rank(self) -> IntArray:
        """Rank of each grasp, from 1, in supplied order; shape (n,)."""
        rank = np.empty(len(self.order), np.int64)
        rank[self.order] = np.arange(1, len(self.order) + 1)
        return rank

    @property
    def reachable(self) -> BoolArray:
        """Where the cost is finite, shape (n,)."""
        return np.isfinite(self.cost)


class Ranker:
    """Ranks grasps by the cost of the nearest test grasp of a bin map.

    Made once, used for every image: it holds nothing that changes, so one ranker may
    serve several threads.

    Parameters
    ----------
    bin_map : BinMap

    Attributes
    ----------
    table : GraspTable
        The test grasps with their costs.
    """

    def __init__(self, bin_map: BinMap) -> None:
        self.table: GraspTable = table_from_bin_map(bin_map)
        self._tree = build_tree(self.table)

    @classmethod
    def from_map(cls, path: str | Path) -> Ranker:
        """Load a bin map.

        Raises
        ------
        MapFileError
            The file is not a readable bin map.
        """
        from reachmap.maps import read_bin_map

        return cls(read_bin_map(Path(path)))

    def rank(
        self,
        points: FloatArray,
        directions: FloatArray | None = None,
        rotations: FloatArray | None = None,
        *,
        weights: Sequence[float] = (1.0, 1.0, 1.0),
        likeness: float = 0.0,
        neighbours: int = 1,
        roll: Roll = "as-given",
        scores: FloatArray | None = None,
    ) -> Ranking:
        """Rank grasps given in robot_base.

        Parameters
        ----------
        points : array, shape (n, 3)
            Grasp points [m].
        directions : array, shape (n, 3), optional
            Approach directions into the object; their length does not matter.
        rotations : array, shape (n, 3, 3), optional
            TCP orientations. A row of NaN has none; its direction counts then.
        weights : sequence of 3 float
            α, β, δ of path length, planning time and execution time.
        likeness : float
            ε of the likeness term φ6.
        neighbours : int
            Test points whose costs are blended.
        roll : {"as-given", "free", "fixed"}
            Whether the roll about the approach counts; see :class:`RankSettings`.
        scores : array, shape (n,), optional
            Break ties of J, higher first; the supplied order breaks what remains.

        Raises
        ------
        SettingsError
            Arrays that do not fit together or are not finite; weights out of range.
        """
        settings = RankSettings.of(weights, likeness, neighbours, roll)
        queries = self.queries(points, directions, rotations, roll=settings.roll)
        return self.rank_queries(queries, settings, scores)

    def queries(
        self,
        points: FloatArray,
        directions: FloatArray | None = None,
        rotations: FloatArray | None = None,
        *,
        roll: Roll = "as-given",
    ) -> Queries:
        """Check arrays and say for each grasp whether its roll counts."""
        p = _array(points, "points", (3,), None)
        n = len(p)
        if directions is None and rotations is None:
            raise SettingsError("give directions or rotations")
        R = np.full((n, 3, 3), np.nan) if rotations is None else rotations
        R = _array(R, "rotations", (3, 3), n, finite=False)
        known: BoolArray = np.all(np.isfinite(R), axis=(1, 2))
        _check_rotations(R[known])
        axes = R @ axis_vector(self.table.approach_axis)
        if not known.all():
            if directions is None:
                raise SettingsError("rotations that are NaN need directions")
            given = _array(directions, "directions", (3,), n, finite=False)
            axes = np.where(known[:, None], axes, _unit(given))
        if not np.isfinite(axes).all():
            raise SettingsError("directions must be finite and longer than 0")
        free: BoolArray = ~known if roll == "as-given" else np.full(n, roll == "free")
        if roll == "fixed" and not known.all():
            R = R.copy()
            R[~known] = complete_rotation(
                axes[~known], self.table.bin_pose[:3, :3], self.table.approach_axis
            )
        return Queries(
            points=p, axes=axes, quaternions=_quaternions(R, free), free=free
        )

    def rank_queries(
        self,
        queries: Queries,
        settings: RankSettings,
        scores: FloatArray | None = None,
    ) -> Ranking:
        """Rank grasps that are checked already."""
        table = self.table
        table_cost = grasp_costs(table, settings.weights)
        matches = match(queries, table, self._tree, table_cost)
        outside = outside_map(queries.points, matches.point, table)
        terms = self._terms(queries, matches, table_cost, settings)
        cost = np.where(outside, np.inf, terms.sum(axis=1))
        cost[np.isnan(cost)] = np.inf
        reachable = np.isfinite(cost)
        status = table.status[matches.point, matches.orientation]
        return Ranking(
            order=stable_order(cost, scores),
            cost=cost,
            terms=np.where(reachable[:, None], terms, np.nan),
            status=np.where(outside, np.uint8(OUTSIDE_MAP), status),
            test_grasp=_unravelled(matches, table),
            distance=matches.distance,
            angle=matches.angle,
            roll_free=queries.free.copy(),
            orientation_wxyz=table.quaternions[matches.point, matches.orientation],
        )

    def _terms(
        self,
        queries: Queries,
        matches: Matches,
        table_cost: FloatArray,
        settings: RankSettings,
    ) -> FloatArray:
        """Summands of J, shape (n, 4); NaN where the test grasp is unreachable."""
        table = self.table
        phi = table.normalised[matches.point, matches.orientation]
        if settings.neighbours > 1:
            phi = blended_terms(
                phi,
                queries,
                matches,
                table,
                self._tree,
                table_cost,
                settings.neighbours,
            )
        terms = np.empty((len(queries), 4))
        terms[:, :3] = phi * settings.weights
        terms[:, 3] = settings.likeness * likeness_terms(matches, queries.free, table)
        return terms


def stable_order(cost: FloatArray, scores: FloatArray | None = None) -> IntArray:
    """Order of costs, shape (n,): ties by score, higher first, then as supplied.

    Costs that differ by rounding only, beyond the twelfth decimal, tie. Infinite costs
    come last in supplied order whatever their scores; so do missing (NaN) scores among
    ties.
    """
    key = np.round(cost, 12)
    if scores is None:
        return np.argsort(key, kind="stable")
    worst_first = np.where(np.isnan(scores), -np.inf, scores)
    second = np.where(np.isfinite(cost), -worst_first, 0.0)
    return np.lexsort((second, key))


def _unravelled(matches: Matches, table: GraspTable) -> IntArray:
    place = np.unravel_index(matches.point, table.shape[:3])
    return np.stack([*place, matches.orientation], axis=1)


def _array(
    value: FloatArray,
    name: str,
    row: tuple[int, ...],
    n: int | None,
    *,
    finite: bool = True,
) -> FloatArray:
    array = np.asarray(value, dtype=float)
    if array.shape[1:] != row or array.ndim == 0 or (n is not None and len(array) != n):
        wanted = ("n" if n is None else n, *row)
        raise SettingsError(f"{name} must have the shape {wanted} (got {array.shape})")
    if finite and not np.isfinite(array).all():
        raise SettingsError(f"{name} must be finite")
    return array


def _check_rotations(R: FloatArray) -> None:
    skew = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(initial=0.0)
    if skew > 1e-2 or (np.linalg.det(R) < 0).any():
        raise SettingsError("rotations must be orthonormal with determinant +1")


def _unit(directions: FloatArray) -> FloatArray:
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    return directions / np.where(length > 0, length, np.nan)


def _quaternions(R: FloatArray, free: BoolArray) -> FloatArray:
    quaternions = np.zeros((len(R), 4))
    quaternions[:, 0] = 1.0
    fixed = ~free
    if fixed.any():
        quaternions[fixed] = quaternion_wxyz_from_rotation(R[fixed])
    return quaternions
