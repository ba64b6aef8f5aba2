"""From a grid of predicted scores to a few good places far from each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from reachmap._typing import FloatArray
from reachmap.placement.mapped.candidates import Candidate
from reachmap.placement.mapped.exact import Pose, PoseScore
from reachmap.placement.predicted.prediction import PoseGrid, Prediction
from reachmap.placement.predicted.region import Region

# Scores are interpolated between the lattice's points: a finer grid finds no better
# place, a coarser one misses narrow ones.
STEPS_PER_SQUARE = 4
YAW_STEP_DEG = 15.0


def pose_grid(
    region: Region,
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
    *,
    heights: Sequence[float] = (),
) -> PoseGrid:
    """Grid of poses that fills a region, finer than a map's lattice.

    Parameters
    ----------
    region : Region
    x, y, z : array
        Lattice of the map [m].
    heights : sequence of float
        The only heights of the inner bottom there are [m]; empty: all in the region.
    """
    axes = [
        _steps(region.low[k], region.high[k], _spacing(values) / STEPS_PER_SQUARE)
        for k, values in enumerate((x, y, z))
    ]
    yaw = _steps(region.low[3], region.high[3], np.radians(YAW_STEP_DEG))
    # Turned by half a turn, the bin stands where it stood.
    yaw = yaw[yaw < yaw[0] + np.pi - 1e-9]
    at = np.unique(np.round(heights, 9)) if len(heights) else axes[2]
    return PoseGrid(x=axes[0], y=axes[1], z=at, yaw=yaw)


def single_pose(pose: Pose) -> PoseGrid:
    """Grid of one pose."""
    x, y, z, yaw = (np.array([value]) for value in pose)
    return PoseGrid(x=x, y=y, z=z, yaw=yaw)


def best_at_each_place(
    prediction: Prediction, reason_against: Callable[[Pose], str]
) -> Iterator[Candidate]:
    """Best feasible pose at each place (x, y) of a grid, rows of y first.

    Parameters
    ----------
    prediction : Prediction
    reason_against : callable
        Why a pose is not feasible, "" if it is.

    Yields
    ------
    Candidate
        Where no pose is feasible, the one with the best score and its reason.
    """
    grid = prediction.grid
    for iy in range(len(grid.y)):
        for ix in range(len(grid.x)):
            yield _best_at(prediction, iy, ix, reason_against)


def spread_out(
    candidates: Sequence[Candidate],
    count: int,
    distance_m: float,
    is_usable: Callable[[Candidate], bool] = lambda candidate: True,
) -> list[Candidate]:
    """Best candidates that stand at least a distance apart, best first.

    This is non-maximum suppression: candidates near a better one are skipped.
    So are unusable ones, which are checked only when needed.
    """
    chosen: list[Candidate] = []
    scored = [c for c in candidates if c.score is not None]
    for candidate in sorted(scored, key=rank_key):
        if len(chosen) == count:
            break
        apart = all(apart_m(candidate.pose, c.pose) >= distance_m for c in chosen)
        if apart and is_usable(candidate):
            chosen.append(candidate)
    return chosen


def rank_key(candidate: Candidate) -> tuple[float, float, float, Pose]:
    """Sorts candidates with scores: score, worst point, path length, then pose."""
    score = candidate.score
    if score is None:
        raise ValueError("an excluded candidate has no rank")
    return (
        -round(score.score, 6),
        -round(score.worst_point, 6),
        round(float(np.nan_to_num(score.path_length_rad, nan=0.0)), 6),
        candidate.pose,
    )


def apart_m(a: Pose, b: Pose) -> float:
    """Distance of two bins' centres [m]."""
    return float(np.linalg.norm(np.subtract(a[:3], b[:3])))


def _best_at(
    prediction: Prediction, iy: int, ix: int, reason_against: Callable[[Pose], str]
) -> Candidate:
    grid = prediction.grid
    # Of equal scores the lowest height comes first, then the smallest yaw.
    score = np.round(prediction.score[:, :, iy, ix].T, 6)
    first = ""
    for nth in np.argsort(-score, axis=None, kind="stable").tolist():
        iz, k = divmod(nth, len(grid.yaw))
        pose = (
            float(grid.x[ix]),
            float(grid.y[iy]),
            float(grid.z[iz]),
            float(grid.yaw[k]),
        )
        reason = reason_against(pose)
        if not reason:
            place = (k, iz, iy, ix)
            return Candidate(
                pose=pose,
                score=PoseScore(
                    score=float(prediction.score[place]),
                    worst_point=float(prediction.worst_point[place]),
                    reachable_share=float(prediction.reachable_share[place]),
                    path_length_rad=np.nan,
                ),
            )
        if not first:
            first, best = reason, pose
    return Candidate(pose=best, reason=first)


def _spacing(values: FloatArray) -> float:
    return float(np.diff(values).min()) if len(values) > 1 else 0.1


def _steps(low: float, high: float, step: float) -> FloatArray:
    """Values from low to high, both included, at most a step apart."""
    count = int(np.ceil((high - low) / step - 1e-6)) + 1
    return np.round(np.linspace(low, high, max(count, 1)), 9)
