"""Blended corners: parabolas that leave a polyline only as far as was verified.

At a corner the arm leaves the straight motion a length d before it and joins the next
one d after it, on the parabola that touches both. Run at an even parameter rate it has
one constant acceleration, (u' - u) v²/2d for unit directions u, u' and speed v, so that
the whole motion is trapezoids between corners that are passed at speeds of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.planning.timing import merge_straight

if TYPE_CHECKING:
    from reachmap.core.planning.motion import MotionChecker

HALVINGS = 5
"""Sizes tried at a corner, from half of the shorter motion downwards."""
SWEEPS = 2
"""Times that each corner is looked at; its best size depends on its neighbours'."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlendedPath:
    """A polyline whose corners are blended.

    Attributes
    ----------
    corners : array, shape (n, dof)
        Waypoints, none of them on a straight line between its neighbours [rad].
    blend : array, shape (n,)
        Length d along the joint motion at which each corner is left and joined [rad];
        0 where the arm stops, as at both ends. No corner is passed further away than
        d |u' - u| / 4.
    """

    corners: FloatArray
    blend: FloatArray

    def with_blend(self, k: int, size: float) -> BlendedPath:
        """Copy with another blend at one corner."""
        blend = self.blend.copy()
        blend[k] = size
        return BlendedPath(corners=self.corners, blend=blend)

    def parabola(self, k: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Control points of the blend at a corner, each of shape (dof,)."""
        corner, d = self.corners[k], self.blend[k]
        before, after = self.corners[k - 1] - corner, self.corners[k + 1] - corner
        return (
            corner + before * (d / np.linalg.norm(before)),
            corner,
            corner + after * (d / np.linalg.norm(after)),
        )


def blended(
    path: FloatArray,
    motions: MotionChecker,
    velocity: FloatArray,
    acceleration: FloatArray,
) -> BlendedPath:
    """Blend the corners of a verified path where that saves time and is verified.

    Parameters
    ----------
    path : array, shape (n, dof)
    motions : MotionChecker
        Verifies each parabola as it does straight motions.
    velocity, acceleration : array, shape (dof,)
        Limits [rad/s], [rad/s²].
    """
    corners = merge_straight(path) if len(path) > 1 else path
    found = BlendedPath(corners=corners, blend=np.zeros(len(corners)))
    length = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    verified: dict[tuple[int, float], bool] = {}
    for k in list(range(1, len(corners) - 1)) * SWEEPS:
        most = 0.5 * float(length[k - 1 : k + 1].min())
        sizes = [0.0, *(most * 0.5**halving for halving in range(HALVINGS))]
        tried = [found.with_blend(k, size) for size in sizes]
        for size, one in sorted(
            zip(sizes, tried, strict=True),
            key=lambda pair: blended_time_s(pair[1], velocity, acceleration),
        ):
            if size and (k, size) not in verified:
                verified[k, size] = motions.parabola_is_verified(*one.parabola(k))
            if not size or verified[k, size]:
                found = one
                break
    return found


def blended_time_s(
    path: BlendedPath, velocity: FloatArray, acceleration: FloatArray
) -> float:
    """Shortest time of a blended path with an even speed along each blend [s].

    Parameters
    ----------
    path : BlendedPath
    velocity, acceleration : array, shape (dof,)
        Limits [rad/s], [rad/s²].
    """
    if len(path.corners) < 2:
        return 0.0
    change = np.diff(path.corners, axis=0)
    length = np.linalg.norm(change, axis=1)
    direction = change / length[:, None]
    with np.errstate(divide="ignore"):
        top = (velocity / np.abs(direction)).min(axis=1)
        push = (acceleration / np.abs(direction)).min(axis=1)
    straight = length - path.blend[:-1] - path.blend[1:]
    speed = _corner_speeds(path.blend, direction, top, acceleration)
    _within_reach(speed, straight, push)
    moving = path.blend > 0
    total = float((2 * path.blend[moving] / speed[moving]).sum())
    for k in range(len(length)):
        total += _between_speeds_s(
            straight[k], speed[k], speed[k + 1], float(top[k]), float(push[k])
        )
    return total


def _corner_speeds(
    blend: FloatArray, direction: FloatArray, top: FloatArray, acceleration: FloatArray
) -> FloatArray:
    """Greatest speed of each blend by its own limits, shape (n,)."""
    speed = np.zeros(len(blend))
    turn = np.abs(np.diff(direction, axis=0))
    with np.errstate(divide="ignore"):
        most = np.sqrt(2 * blend[1:-1] * (acceleration / turn).min(axis=1))
    speed[1:-1] = np.minimum(most, np.minimum(top[:-1], top[1:]))
    return speed


def _within_reach(speed: FloatArray, straight: FloatArray, push: FloatArray) -> None:
    """Lower speeds at corners until each is reached from the one before and after."""
    for k in range(1, len(speed)):
        gain = 2 * push[k - 1] * straight[k - 1]
        speed[k] = min(speed[k], np.sqrt(speed[k - 1] ** 2 + gain))
    for k in range(len(speed) - 2, -1, -1):
        gain = 2 * push[k] * straight[k]
        speed[k] = min(speed[k], np.sqrt(speed[k + 1] ** 2 + gain))


def _between_speeds_s(
    length: float, begin: float, end: float, top: float, push: float
) -> float:
    """Time of a straight motion from one speed to another [s]."""
    peak = min(top, np.sqrt((begin**2 + end**2) / 2 + push * length))
    ramps = (2 * peak**2 - begin**2 - end**2) / (2 * push)
    return float((2 * peak - begin - end) / push + max(length - ramps, 0.0) / peak)
