"""Closed-form inverse kinematics by EAIK, with what EAIK leaves to its caller.

EAIK finds all branches of six-axis arms of known structure in microseconds. Left to
the caller are: rows that do not meet the pose, singular poses (branches are missing
there, and its least-squares flag cannot be relied on), joint limits and whole turns.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.kinematics.closed_form import (
    ACCEPTED,
    MET,
    SELF_TESTS,
    ClosedForm,
    find_closed_form,
    special_configurations,
)
from reachmap.core.kinematics.least_squares import (
    least_squares_many,
    matrix_difference,
    refine_many,
)
from reachmap.core.kinematics.nominal import rounded_arm
from reachmap.core.kinematics.solutions import (
    Rows,
    angular_distance,
    distinct,
    joined,
    wrapped,
)
from reachmap.core.kinematics.solvers.choice import Arm, Way
from reachmap.core.kinematics.solvers.numeric import NumericSolver
from reachmap.geometry import transform_from_parts

# Poses are turned aside by this angle [rad]: enough for EAIK to be regular again.
_ASIDE_RAD = 1e-5

# Regular rows move by 1e-5 rad when the pose is turned aside, and by its square root
# at the edge of reach; at a singularity they jump.
_JUMP_RAD = 0.1

# A pose with this many solutions has all its branches.
_ALL_BRANCHES = 8

# Poses of special configurations that must have a solution: of arms that lose any, most
# lose one in a hundred or more.
_SPECIAL_TESTS = 1000

# Share of the self-test above which a pose has no solution if the closed form has none.
_TRUSTED = 0.98

# Frames per block, which bounds the memory of the pairwise comparison.
_BLOCK = 2048


def _turned(axis: tuple[float, float, float]) -> FloatArray:
    """Small rotation about an axis of the TCP, shape (4, 4)."""
    x, y, z = np.array(axis) * _ASIDE_RAD
    # Of first order, then made orthonormal: exact to 1e-10, more than it needs.
    R, _ = np.linalg.qr(np.array([[1, -z, y], [z, 1, -x], [-y, x, 1]]))
    return transform_from_parts(R * np.sign(np.diag(R)), np.zeros(3))


# A choice: a direction along no axis of the TCP, so that no joint is met by chance.
_ASIDE = _turned((0.48, 0.60, 0.64))

# At a wrist singularity the direction decides which points of the curve are found.
_ASIDE_FOUR_WAYS = tuple(
    _turned(axis) for axis in ((1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0))
)


class AnalyticSolver:
    """All branches of an arm that EAIK knows, or of one near such an arm.

    In a self-test, random configurations are to be found again at their poses, which
    are perturbed in their last places.

    Parameters
    ----------
    arm : Arm
    form : ClosedForm
    """

    def __init__(self, arm: Arm, form: ClosedForm) -> None:
        self._arm, self._chain, self.tolerance = arm, arm.chain, arm.tolerance
        self._form, self._rows = form, form.rows

    @property
    def method(self) -> str:
        """Name that is stored with maps."""
        return "nominal-analytic" if self._form.is_nominal else "analytic"

    @property
    def complete(self) -> bool:
        """Whether a pose without solutions is proved to have none."""
        # At the edge of reach, branches of an arm may lack one of its nominal arm.
        found_all = self._form.score == SELF_TESTS and self._solves_special
        return found_all and not self._form.is_nominal

    @property
    def approximation(self) -> str:
        """How solutions are sought where that proves nothing; "" if complete."""
        if self.complete:
            return ""
        how = "corrected by Newton steps" if self._form.is_nominal else "by EAIK"
        arm = "nominal arm" if self._form.is_nominal else "arm"
        return (
            f"closed form of the {arm}, {how}; a self-test found "
            f"{self._form.score} of {SELF_TESTS} configurations again"
            f"{'' if self._trusted else ', the rest is sought by least squares'}"
            f"{self._arm.rounding_note}"
        )

    def branches(self, T: FloatArray) -> Rows:
        """Solutions that meet their poses, without limits and turns.

        At a wrist singularity the solutions of a pose form curves; points of them
        are returned, the same in each run.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        """
        tables = []
        for start in range(0, len(T), _BLOCK):
            poses = T[start : start + _BLOCK]
            raw, refused = self._rows.with_refused(poses)
            rows = self._with_singular(self._meeting(raw, poses), raw, poses)
            rows = self._with_lost(rows, poses, refused if self._trusted else None)
            tables.append((rows[0], rows[1] + start))
        return joined(tables, self._chain.dof)

    @cached_property
    def _trusted(self) -> bool:
        """Whether a pose has no solution if the closed form has none."""
        return self._form.score >= _TRUSTED * SELF_TESTS and self._solves_special

    @cached_property
    def _solves_special(self) -> bool:
        """Whether poses of special configurations, singular ones too, are solved.

        Of some structures EAIK loses poses at which two joints are at right angles.
        """
        Q = special_configurations(self._chain.dof, _SPECIAL_TESTS)
        exact = rounded_arm(self._chain) if self.tolerance > ACCEPTED else self._chain
        T = exact.forward_many(Q)
        raw, refused = self._rows.with_refused(T)
        _, solved = self._meeting(raw, T)
        singular = np.setdiff1d(np.arange(len(T)), np.union1d(solved, refused))
        T = T[singular]
        raw = self._rows(T)
        _, solved = self._with_singular(self._meeting(raw, T), raw, T)
        return len(np.unique(solved)) == len(T)

    def _with_lost(self, rows: Rows, T: FloatArray, among: IntArray | None) -> Rows:
        """Seek numerically what the closed form may have lost, at some poses or all."""
        missing = np.ones(len(T), bool)
        if among is not None:
            missing[:] = False
            missing[among] = True
        missing[rows[1]] = False
        frames = np.flatnonzero(missing)
        if not len(frames):
            return rows
        Q, frame = self._numeric.branches(T[frames])
        return joined([rows, (Q, frames[frame])], self._chain.dof)

    @cached_property
    def _numeric(self) -> NumericSolver:
        return NumericSolver(self._arm)

    def _with_singular(self, rows: Rows, raw: Rows, T: FloatArray) -> Rows:
        """Add what is missing at singular poses."""
        counts = np.bincount(rows[1], minlength=len(T))
        doubtful = np.flatnonzero(counts < _ALL_BRANCHES)
        if not len(doubtful):
            return rows
        singular = doubtful[self._jumps(raw, T, doubtful)]
        if not len(singular):
            return rows
        more = [self._from_aside(T, singular, turn) for turn in _ASIDE_FOUR_WAYS]
        all_rows = joined([rows, *more], self._chain.dof)
        return distinct(all_rows, self._chain.is_revolute)

    def _meeting(self, raw: Rows, T: FloatArray) -> Rows:
        """Distinct rows that meet their pose, those that nearly do polished."""
        Q, frame = raw
        residual = matrix_difference(T[frame], self._chain.forward_many(Q))
        met = residual <= MET
        near = ~met & (residual <= self._form.near)
        if not near.any():
            return distinct((Q[met], frame[met]), self._chain.is_revolute)
        Q_near, missed = self._steps(Q[near], T[frame[near]])
        good = missed <= self.tolerance
        Q_near = wrapped(Q_near, self._chain.is_revolute)
        polished = (Q_near[good], frame[near][good])
        rows = joined([(Q[met], frame[met]), polished], self._chain.dof)
        return distinct(rows, self._chain.is_revolute)

    def _steps(self, Q: FloatArray, T: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Steps to poses: of all rows of a nominal arm, else of few and singular."""
        if not (self._form.is_nominal or self.tolerance > ACCEPTED):
            return refine_many(self._chain, Q, T)
        return least_squares_many(self._chain, Q, T, tolerance=1e-10, iterations=30)

    def _jumps(self, raw: Rows, T: FloatArray, frames: IntArray) -> BoolArray:
        """Whether the rows of a pose jump when the pose is turned aside.

        Counting rows is not enough: where the arm is nearly stretched as well, rows
        that stand for a missing branch are least-squares rows on both sides.
        """
        aside = self._rows(T[frames] @ _ASIDE)
        position = np.full(len(T), -1)
        position[frames] = np.arange(len(frames))
        of_interest = position[raw[1]] >= 0
        here = (raw[0][of_interest], position[raw[1][of_interest]])
        return _differ(
            _padded(here, len(frames)),
            _padded(aside, len(frames)),
            self._chain.is_revolute,
        )

    def _from_aside(self, T: FloatArray, frames: IntArray, turn: FloatArray) -> Rows:
        """Solve poses turned aside, and come back to the poses themselves."""
        Q, index = self._rows(T[frames] @ turn)
        frame = frames[index]
        Q, residual = refine_many(self._chain, Q, T[frame])
        good = residual <= self.tolerance
        return Q[good], frame[good]


def _differ(a: FloatArray, b: FloatArray, is_revolute: BoolArray) -> BoolArray:
    """Whether a frame has a row in one table without a near one in the other."""
    distance = np.zeros((len(a), a.shape[1], b.shape[1]))
    for k, turns in enumerate(is_revolute):
        difference = a[:, :, None, k] - b[:, None, :, k]
        np.maximum(distance, angular_distance(difference, turns), out=distance)
    # A comparison with padding is NaN, hence not near.
    near = distance <= _JUMP_RAD
    alone_a = ~near.any(axis=2) & ~np.isnan(a[:, :, 0])
    alone_b = ~near.any(axis=1) & ~np.isnan(b[:, :, 0])
    return np.asarray(alone_a.any(axis=1) | alone_b.any(axis=1))


def _padded(rows: Rows, n: int) -> FloatArray:
    """Rows of n frames side by side, padded with NaN, shape (n, most rows, dof)."""
    Q, frame = rows
    counts = np.bincount(frame, minlength=n)
    table = np.full((n, counts.max(initial=0), Q.shape[1]), np.nan)
    slot = np.arange(len(Q)) - np.repeat(np.cumsum(counts) - counts, counts)
    table[frame, slot] = Q
    return table


def _offer(arm: Arm) -> AnalyticSolver | None:
    form = find_closed_form(arm.chain, tolerance=arm.tolerance)
    return None if form is None else AnalyticSolver(arm, form)


WAY = Way(rank=1, is_closed_form=True, offer=_offer)
