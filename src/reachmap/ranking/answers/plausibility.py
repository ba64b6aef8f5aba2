"""Plausibility warnings for a list that the map covers less than expected.

A list in other units, with normals for approach directions or in another frame looks
well-formed, and every row of it is wrong. Where part of a list is unlike the map, the
usual mistakes are undone one by one; one that would make it alike is asked about.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from reachmap.geometry import (
    approach_directions,
    quaternion_wxyz_from_rotation,
    rotation_from_quaternion_wxyz,
    yaw_transform,
)
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lookup.costs import UNMATCHED, Ranking

SOME: Final = 0.1
"""Share of unmatched grasps from which a list is looked at more closely: a heap has a
few that lean too far or lie too near a wall."""
MANY: Final = 0.3
"""Share from which it is asked about even where no mistake explains it."""
RESOLVED: Final = 0.7
"""Share of those that a mistake, undone, must bring back to be asked about."""


# No arm in the field reaches beyond 5 m, and no bin is 2 mm wide.
MILLIMETRES_FROM_M: Final = 5.0
METRES_BELOW_M: Final = 2e-3
# Grasps at the origin itself are in no unit.
NOWHERE_M: Final = 1e-6


def matched_count(ranking: Ranking) -> int:
    """Number of grasps within the map."""
    return int((~np.isin(ranking.status, [*UNMATCHED])).sum())


def plausibility_warnings(
    grasps: GraspList, ranking: Ranking, rank: Callable[[GraspList], Ranking]
) -> tuple[str, ...]:
    """Warnings about mistakes that would explain why a list does not fit the map.

    Parameters
    ----------
    grasps : GraspList
    ranking : Ranking
        Of the list as it is.
    rank : callable
        Ranks a list with the same settings.

    Returns
    -------
    tuple of str
        Sentences, none for a list that fits.
    """
    total, matched = len(grasps), matched_count(ranking)
    missing = total - matched
    away_m = np.linalg.norm(grasps.points, axis=1)
    away_m = away_m[np.isfinite(away_m)]
    far_m = float(np.median(away_m)) if len(away_m) else 0.0
    # A list shrunk to a thousandth falls onto the origin, which may lie in the map.
    if NOWHERE_M < far_m < METRES_BELOW_M:
        grown = matched_count(rank(_scaled(grasps, 1e3)))
        if grown >= max(matched, RESOLVED * total):
            where = f"half of the points lie within {1e3 * far_m:.2g} mm of the origin"
            return (f"{where}; are these metres, not millimetres? ({grown} would be)",)
    if not total or missing < SOME * total:
        return ()
    what = f"{missing} of {total} grasps are nowhere near what the map knows"
    for question, other in _usual_mistakes(grasps, far_m):
        better = matched_count(rank(other))
        if better - matched >= RESOLVED * missing:
            return (f"{what}; {question} ({better} would be)",)
    if missing < MANY * total:
        return ()
    return (f"{what}; are the frame ({grasps.frame}) and the map right?",)


def _usual_mistakes(grasps: GraspList, far_m: float) -> Iterator[tuple[str, GraspList]]:
    """Possible mistakes, each with the list as it would be without it."""
    normals = "are these outward normals? then direction_convention: outward_normal"
    millimetres = 'are these millimetres? then units: {"length": "mm"}'
    both = "are these outward normals in millimetres? then state units and convention"
    quarter = "is the frame turned by a quarter about z, x and y exchanged?"
    half = "is the frame turned by half about z, as base and base_link of a UR are?"
    if grasps.has_rotation.any():
        yield "does the tool's roll not matter? then --roll free", _unrolled(grasps)
        yield "are quaternions in the other order?", _reordered(grasps)
    yield normals, _turned(grasps)
    # Only what is as far out as millimetres would be: anything shrunk to a thousandth
    # falls onto the origin.
    if far_m > MILLIMETRES_FROM_M:
        yield millimetres, _scaled(grasps, 1e-3)
        yield both, _scaled(_turned(grasps), 1e-3)
    yield quarter, _yawed(grasps, np.pi / 2)
    yield half, _yawed(grasps, np.pi)


def _turned(grasps: GraspList) -> GraspList:
    """The list with every approach the other way round."""
    about_x = np.diag([1.0, -1.0, -1.0])
    about_y = np.diag([-1.0, 1.0, -1.0])
    turn = about_y if grasps.approach_axis.endswith("x") else about_x
    return replace(
        grasps, directions=-grasps.directions, rotations=grasps.rotations @ turn
    )


def _unrolled(grasps: GraspList) -> GraspList:
    """The list with directions for full orientations."""
    return replace(
        grasps,
        rotations=np.full_like(grasps.rotations, np.nan),
        has_rotation=np.zeros_like(grasps.has_rotation),
    )


def _reordered(grasps: GraspList) -> GraspList:
    """The list with the scalar of its quaternions at the other end."""
    turn = np.zeros(len(grasps), int)
    for row, grasp in enumerate(grasps.document["grasps"]):
        # What was read as w x y z was x y z w, and the other way round.
        turn[row] = ("quaternion_wxyz" in grasp) - ("quaternion_xyzw" in grasp)
    rotations = grasps.rotations.copy()
    directions = grasps.directions.copy()
    for way in (1, -1):
        rows = grasps.has_rotation & (turn == way)
        wxyz = quaternion_wxyz_from_rotation(rotations[rows])
        rotations[rows] = rotation_from_quaternion_wxyz(np.roll(wxyz, way, axis=-1))
        directions[rows] = approach_directions(rotations[rows], grasps.approach_axis)
    return replace(grasps, directions=directions, rotations=rotations)


def _yawed(grasps: GraspList, angle_rad: float) -> GraspList:
    """The list in a frame that is turned about z."""
    R = yaw_transform(0.0, 0.0, 0.0, angle_rad)[:3, :3]
    return replace(
        grasps,
        points=grasps.points @ R.T,
        directions=grasps.directions @ R.T,
        rotations=R @ grasps.rotations,
    )


def _scaled(grasps: GraspList, factor: float) -> GraspList:
    T = grasps.T_frame_bin
    if T is not None:
        T = T.copy()
        T[:3, 3] *= factor
    return replace(grasps, points=grasps.points * factor, T_frame_bin=T)
