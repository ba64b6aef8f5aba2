"""Closed forms by EAIK, and the search for one that solves a given arm.

EAIK takes axes of equal direction for parallel, not opposite ones; it is fragile for
arms of four axes, which a fifth that stays at zero makes robust; it may raise, and
for arms that are redundant in themselves it ends the process. Here, an arm is turned
into one that EAIK can be given, and what it answers is tried before it is believed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from eaik.pybindings import EAIK

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.kinematics.least_squares import least_squares_many, matrix_difference
from reachmap.core.kinematics.nominal import NOMINAL_ARMS, rounded_arm
from reachmap.core.kinematics.solutions import Rows, angular_distance
from reachmap.core.robot.chain import SerialChain

# EAIK's solutions miss by 1e-12 where they meet a pose.
MET = 1e-9

# A row that misses by less than this is worth steps to the pose [m or rad]: of the
# arm itself, and of a nominal arm.
_NEAR = 1e-3
_NEAR_NOMINAL = 0.2

# Axes are parallel to EAIK within 1e-13.
_PARALLEL = 1e-12

# EAIK knows arms of up to this many axes.
_AXES = 6

# Random configurations that a closed form must find again before it is used, but for
# two, as a nominal arm may lack a branch at the edge of reach; and of the self-test.
_TRIALS = 12
SELF_TESTS = 200

# A refined row that misses its pose by no more than this is a solution [m and rad].
ACCEPTED = 1e-7

# A configuration whose Jacobian has a smaller singular value is not a fair trial.
_REGULAR = 1e-3


# A larger tolerance allows for rounded angles; what they miss a pose by moves joints
# by at most this much more in a fair trial [rad per m or rad].
_FOR_ROUNDED = 1e-6
_ROUNDED_APART = 100.0


class EaikRows:
    """EAIK's raw rows for many poses.

    Parameters
    ----------
    chain : SerialChain
        Revolute joints only.
    dof : int, optional
        Number of leading joints that are returned; default: all.

    Raises
    ------
    RuntimeError
        EAIK cannot be given the arm.
    """

    def __init__(self, chain: SerialChain, dof: int | None = None) -> None:
        self._dof = chain.dof if dof is None else dof
        signs = _common_signs(chain.axes_base)
        self._signs = signs[: self._dof]
        self._robot = EAIK.Robot(
            chain.axes_base * signs, chain.offsets_base, chain.R_base_tcp_zero, [], True
        )

    def __call__(self, T: FloatArray) -> Rows:
        """Rows of all poses, least-squares ones included, (n, 4, 4) to a table."""
        return self.with_refused(T)[0]

    def with_refused(self, T: FloatArray) -> tuple[Rows, IntArray]:
        """The rows, and the poses at which EAIK raised an exception, and gives none."""
        found = [self._at(pose) for pose in T]
        refused = np.flatnonzero([rows is None for rows in found])
        counts = [0 if rows is None else len(rows) for rows in found]
        frame = np.repeat(np.arange(len(T)), counts)
        # Without solutions EAIK's array may lack columns as well as rows.
        some = [
            rows[:, : self._dof] for rows in found if rows is not None and len(rows)
        ]
        Q = np.concatenate([np.zeros((0, self._dof)), *some])
        finite = np.isfinite(Q).all(axis=1)
        return (Q[finite] * self._signs, frame[finite]), refused

    def _at(self, pose: FloatArray) -> FloatArray | None:
        try:
            return np.asarray(self._robot.calculate_IK(pose).Q)
        except (RuntimeError, ValueError, IndexError):
            return None

    @property
    def is_known(self) -> bool:
        """Whether EAIK has a decomposition for the structure."""
        # For five axes the flag is true even when the family is unknown.
        known = bool(self._robot.has_known_decomposition())
        return known and "Unknown" not in str(self._robot.get_kinematic_family())


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedForm:
    """A closed form of an arm, or of a nominal arm near it.

    Attributes
    ----------
    rows : EaikRows
    is_nominal : bool
        Whether the closed form is of another arm, from whose rows steps lead to the
        arm's solutions.
    kind : int
        Which of the nominal arms it is of.
    score : int
        Configurations of the self-test that are found again, of `SELF_TESTS`.
    """

    rows: EaikRows
    is_nominal: bool
    kind: int
    score: int = 0

    @property
    def near(self) -> float:
        """Largest miss of a row that is worth steps [m or rad]."""
        return _NEAR_NOMINAL if self.is_nominal else _NEAR


def find_closed_form(
    chain: SerialChain,
    *,
    tolerance: float = ACCEPTED,
    tests: int = SELF_TESTS,
    like: ClosedForm | None = None,
) -> ClosedForm | None:
    """Closed form that finds random configurations of an arm again, if there is one.

    The nearest nominal arm is preferred, and of it the one with the fewest axes added,
    unless a later one passes more of the self-test, `tests` configurations. With
    `like`, only the nominal arm is looked at that gave this form of a similar arm.
    """
    if not chain.is_revolute.all() or chain.dof > _AXES:
        return None
    best = None
    for form in _candidates(chain, like):
        score = _count(form, chain, _TRIALS, tolerance)
        if score < _TRIALS - 2:
            continue
        if tests > _TRIALS:
            score = _count(form, chain, tests, tolerance)
        if best is None or score > best.score:
            best = replace(form, score=score)
        if score == tests:
            break
    return best


def _candidates(chain: SerialChain, like: ClosedForm | None) -> Iterator[ClosedForm]:
    """Forms that EAIK claims to know."""
    Q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_TRIALS, chain.dof))
    poses = chain.forward_many(Q)
    for kind, way in enumerate(NOMINAL_ARMS):
        nominal = way(chain) if like is None or kind == like.kind else None
        if nominal is None:
            continue
        apart = matrix_difference(poses, nominal.forward_many(Q)).max()
        for padded in _padded(nominal):
            rows = _rows(padded, chain.dof)
            if rows is not None:
                is_nominal = bool(apart > 10 * MET)
                yield ClosedForm(rows=rows, is_nominal=is_nominal, kind=kind)


def _count(form: ClosedForm, chain: SerialChain, count: int, tolerance: float) -> int:
    return int(_found_again(form, chain, count, tolerance).sum())


def _found_again(
    form: ClosedForm, chain: SerialChain, count: int, tolerance: float
) -> BoolArray:
    """Whether random configurations are among the solutions of their poses.

    The poses are perturbed, as those of a lattice or of another library are: by
    1e-16 to 1e-10.

    Parameters
    ----------
    form : ClosedForm
    chain : SerialChain
    count : int
        Number of configurations.
    tolerance : float
        Largest miss of a solution [m and rad]. If it allows for rounded angles, the
        poses are those of the arm with exact ones.

    Returns
    -------
    array of bool, shape (count,)
    """
    Q = _regular_configurations(chain, count)
    rng = np.random.default_rng(1)
    poses = rounded_arm(chain) if tolerance > _FOR_ROUNDED else chain
    T = poses.forward_many(Q)
    size = 10.0 ** rng.uniform(-16, -10, (count, 1, 1))
    T[:, :3] += size * rng.standard_normal((count, 3, 4))
    found, frame = form.rows(T)
    residual = matrix_difference(T[frame], chain.forward_many(found))
    near = residual <= form.near
    found, frame = found[near], frame[near]
    found, residual = least_squares_many(
        chain, found, T[frame], tolerance=1e-9, iterations=12, patience=6
    )
    apart = angular_distance(found - Q[frame], chain.is_revolute).max(axis=1)
    good = (residual < tolerance) & (apart < max(1e-5, _ROUNDED_APART * tolerance))
    return np.isin(np.arange(count), frame[good])


def _regular_configurations(chain: SerialChain, count: int) -> FloatArray:
    rng = np.random.default_rng(2)
    Q = rng.uniform(-np.pi, np.pi, (4 * count, chain.dof))
    # Tools that point straight down, as most do, put joints at right angles.
    Q[1::2] = special_configurations(chain.dof, 2 * count)
    _, J = chain.jacobian_many(Q)
    smallest = np.linalg.svd(J, compute_uv=False)[:, -1]
    order = np.argsort(smallest < _REGULAR * smallest.max(), kind="stable")
    return Q[order[:count]]


def special_configurations(dof: int, count: int) -> FloatArray:
    """Random configurations with about every second joint at a multiple of 30 degrees.

    Axes are parallel or meet there that do not elsewhere, and closed forms fail.
    """
    rng = np.random.default_rng(3)
    Q = rng.uniform(-np.pi, np.pi, (count, dof))
    plain = np.radians(30.0 * rng.integers(-6, 7, Q.shape))
    return np.where(rng.random(Q.shape) < 0.5, plain, Q)


def _rows(chain: SerialChain, dof: int) -> EaikRows | None:
    """EAIK for an arm that it knows.

    The rank is tested before EAIK sees the arm: four parallel axes, for example,
    end the process with a segmentation fault.
    """
    rng = np.random.default_rng(0)
    _, J = chain.jacobian_many(rng.uniform(-np.pi, np.pi, (_TRIALS, chain.dof)))
    if np.linalg.matrix_rank(J, tol=1e-6).max() < chain.dof:
        return None
    try:
        rows = EaikRows(chain, dof)
    except (RuntimeError, ValueError):  # for example meeting axes that are parallel
        return None
    return rows if rows.is_known else None


def _padded(chain: SerialChain) -> Iterator[SerialChain]:
    """The arm, then the arm with an axis more, at three places across the last one."""
    yield chain
    if not 0 < chain.dof < _AXES:
        return
    T = chain.tcp_at_zero
    last = chain.axes_base[:, -1]
    across = np.cross(np.eye(3)[int(np.argmin(np.abs(last)))], last)
    across /= np.linalg.norm(across)
    # The third place is special to no arm.
    beside = T[:3, 3] + np.array([0.07, 0.05, 0.11])
    for point in (T[:3, 3], chain.points_base[-1], beside):
        yield SerialChain.from_axes(
            np.vstack([chain.axes_base.T, across]),
            np.vstack([chain.points_base, point]),
            T,
            np.append(chain.is_revolute, True),
        )


def _common_signs(axes: FloatArray) -> FloatArray:
    """Signs that give parallel axes one direction, shape (n,) for axes (3, n)."""
    signs = np.ones(axes.shape[1])
    for k in range(1, len(signs)):
        across = np.linalg.norm(np.cross(axes[:, :k].T, axes[:, k]), axis=1)
        parallel = np.flatnonzero(across < _PARALLEL)
        if len(parallel):
            j = parallel[0]
            signs[k] = signs[j] * np.sign(axes[:, j] @ axes[:, k])
    return signs
