"""The tool poses a picking loop may take for a grasp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.geometry import rotation_from_quaternion_wxyz, transform_from_parts
from reachmap.maps.parts import freeze
from reachmap.ranking.answers.ranked_list import RankedList
from reachmap.ranking.lookup.queries import align


@dataclass(frozen=True, slots=True, kw_only=True)
class Picks:
    """Grasps to be planned to, in robot_base.

    Attributes
    ----------
    points : array, shape (n, 3)
        [m].
    axes : array, shape (n, 3)
        Unit approach directions.
    quaternion_wxyz : array, shape (n, 4)
        The grasp's own tool orientation; where its roll is free, that of its test
        grasp, which the ranking recommends.
    free : bool array, shape (n,)
        Whether the tool may turn about the approach direction.
    number : int array, shape (n,)
        Place in the own list, which with the seed makes the attempts' seeds: a list
        gives the same verdicts alone and together with others.
    """

    points: FloatArray
    axes: FloatArray
    quaternion_wxyz: FloatArray
    free: BoolArray
    number: IntArray

    def __post_init__(self) -> None:
        freeze(self)

    def __len__(self) -> int:
        return len(self.points)


def picks_of(ranked: RankedList) -> Picks:
    """Picks of a ranked list, in supplied order."""
    queries, ranking = ranked.queries, ranked.ranking
    return Picks(
        points=queries.points.copy(),
        axes=queries.axes.copy(),
        quaternion_wxyz=np.where(
            queries.free[:, None], ranking.orientation_wxyz, queries.quaternions
        ),
        free=queries.free.copy(),
        number=np.arange(len(queries)),
    )


def tool_poses(picks: Picks, row: int, *, rolls: int, approach_axis: str) -> FloatArray:
    """Tool poses of one grasp: one if its roll is fixed, else one for each roll.

    The first is the recommended orientation, turned by the least rotation so that it
    approaches exactly as the grasp says; the others are that one rolled about the
    approach direction in equal steps.

    Parameters
    ----------
    picks : Picks
    row : int
    rolls : int
        Steps in a full turn.
    approach_axis : str
        TCP axis that points into the object.

    Returns
    -------
    array, shape (m, 4, 4)
        T_base_tcp.
    """
    R = rotation_from_quaternion_wxyz(picks.quaternion_wxyz[row])
    if not picks.free[row]:
        return transform_from_parts(R[None], picks.points[row])
    axis = picks.axes[row]
    R = align(R, axis[None], approach_axis)
    angles = 2.0 * np.pi * np.arange(rolls) / rolls
    turns = Rotation.from_rotvec(angles[:, None] * axis).as_matrix()
    return transform_from_parts(turns @ R, picks.points[row])


NO_PICKS = Picks(
    points=np.zeros((0, 3)),
    axes=np.zeros((0, 3)),
    quaternion_wxyz=np.zeros((0, 4)),
    free=np.zeros(0, bool),
    number=np.zeros(0, np.int64),
)
