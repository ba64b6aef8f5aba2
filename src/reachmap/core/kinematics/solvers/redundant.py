"""Inverse kinematics of redundant arms: joints on a grid, EAIK for the rest.

The redundant joint is one of a seven-axis arm, or a rail or gantry that carries an
arm. The solutions of a pose form curves; the grid takes points from them. For a pose
that has none on the grid they are sought numerically: the method is not complete.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import product

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.kinematics.closed_form import (
    ACCEPTED,
    MET,
    ClosedForm,
    find_closed_form,
)
from reachmap.core.kinematics.least_squares import least_squares_many, matrix_difference
from reachmap.core.kinematics.solutions import (
    Rows,
    can_be_within,
    distinct,
    in_blocks,
    joined,
    wrapped,
)
from reachmap.core.kinematics.solvers.choice import FULL_AXES, Arm, Way
from reachmap.core.kinematics.solvers.numeric import NumericSolver

# Rows of a nominal arm that miss by more [m or rad] are not worth steps.
_NEAR_NOMINAL = 0.2

# Self-test of the closed form for each value; the whole is never complete anyway.
_TESTS = 12

# Poses that tell whether a joint is one to sample, and the share of them that is good
# enough: Panda, iiwa and xArm7 reach it with their last joint.
_POSES = 60
_GOOD_SHARE = 0.9

# Frames per block, which bounds the memory.
_BLOCK = 256


class RedundantSolver:
    """Branches for each value of the joints that are sampled.

    Parameters
    ----------
    arm : Arm
    joints : tuple of int
        Joints that are sampled.
    like : ClosedForm
        Closed form of the other joints at typical values of these.

    Attributes
    ----------
    values : list of tuple of float
        Values of these joints for which the others have a closed form.
    """

    method = "redundant-grid"
    complete = False
    tolerance = ACCEPTED

    def __init__(self, arm: Arm, joints: tuple[int, ...], like: ClosedForm) -> None:
        self._arm, self._chain = arm, arm.chain
        self._lower, self._upper = arm.lower, arm.upper
        self._joints = joints
        self._others = [k for k in range(arm.chain.dof) if k not in joints]
        self.values: list[tuple[float, ...]] = []
        self._forms: list[ClosedForm] = []
        for values in product(*self._grids()):
            form = _closed_form_with(arm, joints, values, like)
            if form is not None:
                self.values.append(values)
                self._forms.append(form)

    def _grids(self) -> Iterator[list[float]]:
        # Several joints share the samples, or their number would be squared.
        share = self._arm.spec.redundant_samples ** (1.0 / len(self._joints))
        for k in self._joints:
            yield _grid(
                self._lower[k],
                self._upper[k],
                int(np.ceil(share)),
                turns=bool(self._chain.is_revolute[k]),
            ).tolist()

    @property
    def approximation(self) -> str:
        """How solutions are sought."""
        table = np.array(self.values)
        parts = []
        for k, column in zip(self._joints, table.T, strict=True):
            scale, unit = (
                (180.0 / np.pi, "deg") if self._chain.is_revolute[k] else (1.0, "m")
            )
            digits = 0 if unit == "deg" else 2
            low, high = (f"{v:.{digits}f}" for v in np.sort(column)[[0, -1]] * scale)
            parts.append(
                f"{self._arm.joint_names[k]} sampled at {len(np.unique(column))} "
                f"values from {low} to {high} {unit}"
            )
        return (
            f"{', '.join(parts)}, the other joints in closed form; "
            "least squares where that finds none"
        )

    def branches(self, T: FloatArray) -> Rows:
        """Solutions that meet their poses, some turn of them within the limits.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        """
        return in_blocks(self._block, T, _BLOCK, self._chain.dof)

    def share_on_grid(self) -> float:
        """Share of random poses that have a solution at a value of the grid.

        The elbow of an arm with a spherical shoulder and wrist, for example, is no
        joint to sample: the distance of the wrist determines it.
        """
        rng = np.random.default_rng(0)
        Q = rng.uniform(self._lower, self._upper, (_POSES, self._chain.dof))
        _, frame = self._on_grid(self._chain.forward_many(Q))
        return len(np.unique(frame)) / _POSES

    def _block(self, T: FloatArray) -> Rows:
        rows = self._on_grid(T)
        missing = np.flatnonzero(np.bincount(rows[1], minlength=len(T)) == 0)
        if not len(missing):
            return rows
        # Near the edge of reach the curves of solutions are shorter than the spacing.
        Q, frame = self._allowed(self._between_samples.branches(T[missing]))
        return joined([rows, (Q, missing[frame])], self._chain.dof)

    @cached_property
    def _between_samples(self) -> NumericSolver:
        return NumericSolver(self._arm)

    def _on_grid(self, T: FloatArray) -> Rows:
        tables = [
            self._rows(form, values, T)
            for form, values in zip(self._forms, self.values, strict=True)
        ]
        allowed = [self._allowed(table) for table in tables]
        Q, frame = joined(allowed, self._chain.dof)
        residual = matrix_difference(T[frame], self._chain.forward_many(Q))
        met = residual <= MET
        solved = [(Q[met], frame[met])]
        if any(form.is_nominal for form in self._forms):
            near = ~met & (residual <= _NEAR_NOMINAL)
            solved.append(self._polished(Q[near], frame[near], T))
        rows = joined(solved, self._chain.dof)
        return distinct(rows, self._chain.is_revolute)

    def _rows(self, form: ClosedForm, values: tuple[float, ...], T: FloatArray) -> Rows:
        Q_others, frame = form.rows(T)
        Q = np.empty((len(frame), self._chain.dof))
        Q[:, self._others] = Q_others
        Q[:, list(self._joints)] = values
        return Q, frame

    def _polished(self, Q: FloatArray, frame: IntArray, T: FloatArray) -> Rows:
        Q, missed = least_squares_many(
            self._chain, Q, T[frame], tolerance=1e-10, iterations=20
        )
        good = missed <= ACCEPTED
        return self._allowed((wrapped(Q[good], self._chain.is_revolute), frame[good]))

    def _allowed(self, rows: Rows) -> Rows:
        keep = can_be_within(rows[0], self._lower, self._upper, self._chain.is_revolute)
        return rows[0][keep], rows[1][keep]


def _grid(lower: float, upper: float, samples: int, *, turns: bool) -> FloatArray:
    """Values from limit to limit, or once around if the joint turns further."""
    if samples == 1:
        return np.array([(lower + upper) / 2])
    once_around = 2.0 * np.pi * (1.0 - 1.0 / samples) if turns else np.inf
    return np.linspace(lower, lower + min(upper - lower, once_around), samples)


def _closed_form_with(
    arm: Arm,
    joints: tuple[int, ...],
    values: tuple[float, ...],
    like: ClosedForm | None = None,
) -> ClosedForm | None:
    """Closed form of the other joints while these stay at values."""
    chain = arm.chain
    for joint, value in sorted(zip(joints, values, strict=True), reverse=True):
        chain = chain.held(joint, value)
    return find_closed_form(chain, tests=_TESTS, like=like)


def _candidates(arm: Arm) -> list[tuple[int, ...]]:
    """Joints that may be sampled, so that six are left; rails first."""
    chain, named = arm.chain, arm.spec.redundant_joint
    rails = tuple(np.flatnonzero(~chain.is_revolute).tolist())
    turning = [k for k in reversed(range(chain.dof)) if k not in rails]
    left = chain.dof - FULL_AXES - len(rails)
    choices = [rails] if left == 0 else [(*rails, k) for k in turning if left == 1]
    if named is None:
        return choices
    joint = arm.joint_names.index(named)
    return [choice for choice in choices if joint in choice]


def _offer(arm: Arm) -> RedundantSolver | None:
    if arm.chain.dof <= FULL_AXES:
        return None
    # A value that is special for no arm: held at zero, axes may become parallel.
    typical = arm.lower + 0.37 * (arm.upper - arm.lower)
    best, most = None, 0.0
    for joints in _candidates(arm):
        form = _closed_form_with(arm, joints, tuple(typical[k] for k in joints))
        if form is None:
            continue
        solver = RedundantSolver(arm, joints, form)
        share = solver.share_on_grid()
        if share > most:
            best, most = solver, share
        if share >= _GOOD_SHARE:
            break
    return best


WAY = Way(rank=2, is_closed_form=True, offer=_offer)
