"""Shortening of a found path.

First every waypoint that can be skipped is skipped, looking from the far end by
halving; then the path ends at another goal if one is nearer; then random pairs of
points on the path are joined where that is shorter (Geraerts and Overmars, "Creating
high-quality paths for motion planning", 2007). A path that is to be run stops at each
of its waypoints; *settling* moves them about, and makes one of two, until that stops
gaining. The work is counted in tries, so the result depends on the seed alone.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.planning.timing import Pace, merge_straight

MotionTest = Callable[[FloatArray, FloatArray], bool]
# A path that is shorter by less than repeats a motion check for nothing.
_LEAST_GAIN_RAD = 1e-3
# Moves of waypoints between two looks at the gain, and a bound that is hardly met. The
# first moves are as long as half a door is wide, those of later blocks shorter. Shares
# and numbers by the spread of the cost between seeds, of ways round a disc and through
# the door of a machine.
_MOVES, _MOST_BLOCKS = 25, 12
_FIRST_MOVE_RAD, _SHORTER = 0.3, 0.8
_MERGE_SHARE, _PULL_SHARE = 0.3, 0.5
_LEAST_GAIN_S = 1e-3


def shorten(
    path: FloatArray,
    is_free: MotionTest,
    *,
    tries: int,
    rng: np.random.Generator,
    goals: FloatArray | None = None,
) -> FloatArray:
    """Skip waypoints, look for a nearer goal, then cut corners.

    Parameters
    ----------
    path : array, shape (n, dof)
    is_free : callable
        ``is_free(q_from, q_to)`` of a straight motion.
    tries : int
        Corners that are tried.
    rng : numpy.random.Generator
    goals : array, shape (k, dof), optional
        Configurations at any of which the path may end.

    Returns
    -------
    array, shape (m, dof)
        Never longer; ends as before, or at one of the goals.
    """
    path = skip_waypoints(path, is_free)
    if goals is not None:
        path = end_at_nearer_goal(path, goals, is_free)
    return cut_corners(path, is_free, tries=tries, rng=rng)


def skip_waypoints(path: FloatArray, is_free: MotionTest) -> FloatArray:
    """Join each waypoint to the furthest later one that halving finds."""
    kept = list(path)
    start = 0
    while start < len(kept) - 2:
        target = len(kept) - 1
        while target > start + 1:
            if is_free(kept[start], kept[target]):
                del kept[start + 1 : target]
                break
            target = start + 1 + (target - start - 1) // 2
        start += 1
    return np.array(kept)


def end_at_nearer_goal(
    path: FloatArray, goals: FloatArray, is_free: MotionTest
) -> FloatArray:
    """Leave the path at a waypoint, straight to a goal, where that is shorter.

    A planner stops at the first goal that it meets. With all goals available, paths are
    shorter and differ less from attempt to attempt.
    """
    before = np.concatenate([[0.0], np.cumsum(_steps_rad(path))])
    best, best_rad = path, float(before[-1])
    for k in range(len(path) - 1):
        total = before[k] + np.linalg.norm(goals - path[k], axis=1)
        for row in np.argsort(total, kind="stable"):
            if total[row] > best_rad - _LEAST_GAIN_RAD:
                break
            if is_free(path[k], goals[row]):
                best, best_rad = np.vstack([path[: k + 1], goals[row]]), total[row]
                break
    return best


def cut_corners(
    path: FloatArray, is_free: MotionTest, *, tries: int, rng: np.random.Generator
) -> FloatArray:
    """Join random pairs of points on the path where that shortens it."""
    for cut in rng.random((tries, 2)):
        if len(path) < 3:
            break
        arc = np.concatenate([[0.0], np.cumsum(_steps_rad(path))])
        begin, end = np.sort(cut) * arc[-1]
        first, last = (
            np.searchsorted(arc, (begin, end), side="right").clip(1, len(path) - 1) - 1
        )
        if first == last:
            continue
        q_from = _point_at(path, arc, first, begin)
        q_to = _point_at(path, arc, last, end)
        gain = (end - begin) - float(np.linalg.norm(q_to - q_from))
        if gain > _LEAST_GAIN_RAD and is_free(q_from, q_to):
            path = np.vstack([path[: first + 1], q_from, q_to, path[last + 1 :]])
    return path


def settle(
    path: FloatArray,
    is_free: MotionTest,
    pace: Pace,
    rng: np.random.Generator,
    least_gain: float,
) -> FloatArray:
    """Move waypoints, and make one of two, until that stops gaining.

    Cutting corners shortens a path and adds waypoints, at which the arm stops; how
    many is luck. What is settled is a local optimum of time and length together.

    Parameters
    ----------
    path : array, shape (n, dof)
    is_free : callable
        ``is_free(q_from, q_to)`` of a straight motion.
    pace : Pace
    rng : numpy.random.Generator
    least_gain : float
        A block of moves that gains a smaller share of the cost is the last one.

    Returns
    -------
    array, shape (m, dof)
        With the same ends, never dearer.
    """
    path = merge_straight(skip_waypoints(path, is_free))
    cost, move_rad = pace.of_path(path), _FIRST_MOVE_RAD
    for _ in range(_MOST_BLOCKS):
        for _ in range(_MOVES if len(path) > 2 else 0):
            path = _try_a_move(path, is_free, pace, move_rad, rng)
        path = skip_waypoints(path, is_free)
        now, move_rad = pace.of_path(path), _SHORTER * move_rad
        if len(path) < 3 or cost - now < least_gain * cost:
            break
        cost = now
    return path


def _try_a_move(
    path: FloatArray,
    is_free: MotionTest,
    pace: Pace,
    move_rad: float,
    rng: np.random.Generator,
) -> FloatArray:
    """Put a waypoint somewhere else, or one in place of two, where that gains."""
    first = int(rng.integers(1, len(path) - 1))
    taken = 1 + (len(path) - first > 2 and rng.random() < _MERGE_SHARE)
    before, after = path[first - 1], path[first + taken]
    q, change = path[first : first + taken].mean(axis=0), after - before
    along = np.clip((q - before) @ change / max(change @ change, 1e-12), 0.0, 1.0)
    outward = q - before - along * change
    # One in place of two has to go further round, one that pulls in less far.
    if taken > 1:
        q = q + rng.random() * outward + rng.normal(0.0, move_rad / 3, len(q))
    elif rng.random() < _PULL_SHARE:
        q = q - rng.random() * outward + rng.normal(0.0, move_rad / 3, len(q))
    else:
        q = q + rng.normal(0.0, move_rad, len(q))
    old, new = path[first - 1 : first + taken + 1], np.array([before, q, after])
    gain = pace.of_path(old) - pace.of_path(new)
    if gain < _LEAST_GAIN_S or not (is_free(before, q) and is_free(q, after)):
        return path
    return np.vstack([path[:first], q, path[first + taken :]])


def _steps_rad(path: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(np.diff(path, axis=0), axis=1))


def _point_at(
    path: FloatArray, arc: FloatArray, segment: int, position: float
) -> FloatArray:
    share = (position - arc[segment]) / max(arc[segment + 1] - arc[segment], 1e-12)
    return np.asarray(path[segment] + share * (path[segment + 1] - path[segment]))
