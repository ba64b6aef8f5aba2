"""Calibrated arms: the closed form of the nominal arm, then steps to the true one.

A calibrated URDF tilts axes that are parallel by design, by 1e-3 rad or less; EAIK
knows the arm only if they are parallel to 1e-13. The nominal arm is found by making
nearly parallel axes parallel, and nearly intersecting ones intersect.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.kinematics.analytic import EaikRows, can_use_eaik
from reachmap.core.kinematics.numeric import ACCEPTED, matrix_difference, refine_many
from reachmap.core.kinematics.solutions import Rows, distinct, joined, wrapped
from reachmap.core.robot.chain import SerialChain

# Largest tilt [rad] and distance [m] that calibration is taken to explain.
_PARALLEL_RAD = 0.01
_MEETING_M = 0.005

# Rows of the nominal arm that miss by more than this [m or rad] on the true arm are
# not worth steps.
_WORTHWHILE = 0.2

# Frames per block, which bounds the memory.
_BLOCK = 512


class NominalSolver:
    """Branches of an arm that differs slightly from one that EAIK knows.

    Parameters
    ----------
    chain : SerialChain
        The true arm.
    nominal : SerialChain
        As `nominal_chain` makes it.
    """

    method = "nominal-analytic"
    # At the edge of reach, branches of the true arm may lack one of the nominal arm.
    complete = False

    def __init__(self, chain: SerialChain, nominal: SerialChain) -> None:
        self._chain = chain
        self._rows = EaikRows(nominal)

    def branches(self, T: FloatArray) -> Rows:
        """Solutions that meet their poses, without limits and turns.

        Parameters
        ----------
        T : array, shape (n, 4, 4)
            Poses T_base_tcp.
        """
        tables = []
        for start in range(0, len(T), _BLOCK):
            Q, frame = self._block(T[start : start + _BLOCK])
            tables.append((Q, frame + start))
        return joined(tables, self._chain.dof)

    def _block(self, T: FloatArray) -> Rows:
        Q, frame = self._rows(T)
        missed = matrix_difference(T[frame], self._chain.forward_many(Q))
        near = missed <= _WORTHWHILE
        Q, frame = Q[near], frame[near]
        Q, missed = refine_many(
            self._chain, Q, T[frame], tolerance=1e-11, iterations=30
        )
        good = missed <= ACCEPTED
        rows = (wrapped(Q[good], self._chain.is_revolute), frame[good])
        return distinct(rows, self._chain.is_revolute)


def nominal_chain(chain: SerialChain) -> SerialChain | None:
    """Nearest arm that EAIK knows, None if there is none near.

    Only the axes and the vectors between them are those of the nominal arm.
    """
    if not chain.is_revolute.all() or chain.dof != 6:
        return None
    axes, points = _snapped(chain.axes_base.T, np.cumsum(chain.offsets_base.T, axis=0))
    nominal = dataclasses.replace(
        chain,
        axes_base=axes.T.copy(),
        offsets_base=np.diff(points, axis=0, prepend=0.0).T.copy(),
    )
    return nominal if can_use_eaik(nominal, within_rad=0.3) else None


def _snapped(axes: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Axes (6, 3) and points on them, the last one the TCP, (7, 3)."""
    axes, points = axes.copy(), points.copy()
    for k in range(1, len(axes)):
        # Any point of an axis describes it; calibration likes far ones.
        along = axes[k] @ (points[k - 1] - points[k])
        points[k] = points[k] + along * axes[k]
        turn = np.cross(axes[k - 1], axes[k])
        if np.linalg.norm(turn) < _PARALLEL_RAD:
            axes[k] = axes[k - 1] * np.sign(axes[k - 1] @ axes[k])
            continue
        meeting = _meeting_point(axes, points, k)
        if meeting is not None:
            points[k] = meeting
    return axes, points


def _meeting_point(axes: FloatArray, points: FloatArray, k: int) -> FloatArray | None:
    """Point where axis k is to meet the one before, None if they pass at a distance."""
    a, b, between = axes[k - 1], axes[k], points[k] - points[k - 1]
    normal = np.cross(a, b)
    if abs(between @ normal) > _MEETING_M * np.linalg.norm(normal):
        return None
    # Where the common normal leaves the axis before.
    share = np.linalg.det(np.array([between, b, normal])) / (normal @ normal)
    meeting = points[k - 1] + share * a
    if np.linalg.norm(meeting - points[k - 1]) < _MEETING_M:
        # Three axes of a spherical wrist: the last meets where the two before do.
        return np.asarray(points[k - 1])
    return np.asarray(meeting)
