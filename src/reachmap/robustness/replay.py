"""Stored paths in perturbed cells: proved free, or replayed.

A path is proved where the bodies that errors move keep further apart on it than they
are moved: by the clearance that the map holds, or else by the clearance of these bodies
alone. What is not proved is replayed in perturbed cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.core.collision.bodies import build_geometry
from reachmap.core.collision.checker import CollisionChecker
from reachmap.core.collision.clearance import ClearanceMeter, certain_clearance_m
from reachmap.core.collision.misplacement import Misplacement, MovableBodies
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

MOVED = ("bin", "bin and tool", "tool")
"""Kinds of pairs that errors move: one body of the bin and one of the arm, one of the
bin and one of the tool, one of the tool and one of anything else."""
# A replayed path is looked at this densely: contacts that it steps over are shallower
# than half of it.
SPACING_M = 0.001


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredPaths:
    """Paths to test grasps at one filling of the bin.

    Attributes
    ----------
    loaded : LoadedCell
        The cell with that filling.
    paths : tuple of array, shape (n, dof)
    """

    loaded: LoadedCell
    paths: tuple[FloatArray, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replay:
    """What workers need to replay paths.

    Attributes
    ----------
    stored : tuple of StoredPaths
        One for each filling.
    margin_m : float
        Clearance that a path must keep.
    """

    stored: tuple[StoredPaths, ...]
    margin_m: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PerturbedCell:
    """A unit of work: some paths of a filling in one perturbed cell.

    Attributes
    ----------
    filling : int
    rows : int array
        Of the filling's paths.
    misplacement : Misplacement
    """

    filling: int
    rows: IntArray
    misplacement: Misplacement


def measure_unit(context: Replay, unit: tuple[int, range]) -> dict[str, FloatArray]:
    """Certain clearance of some paths of a filling, by kind of pair.

    Returns
    -------
    dict
        ``clearance``, shape (paths, kinds) [m], infinite where there are no pairs;
        ``pair``, shape (paths,), the closest of them in the checker's numbering.
    """
    filling, rows = unit
    stored = context.stored[filling]
    scene = Scene.shared(stored.loaded, with_bin=True)
    kinds = kinds_of_pairs(scene)
    meter = ClearanceMeter(scene.checker)
    clearance = np.full((len(rows), len(MOVED)), np.inf)
    pair = np.full(len(rows), -1)
    for k, row in enumerate(rows):
        closest = np.inf
        for kind in range(len(MOVED)):
            found, which = meter.of_path(stored.paths[row], kinds == kind)
            if which >= 0:
                clearance[k, kind] = certain_clearance_m(np.array(found))
            if found < closest:
                closest, pair[k] = found, which
    return {"clearance": clearance, "pair": pair}


def kinds_of_pairs(scene: Scene) -> IntArray:
    """Index into ``MOVED`` of each pair of the checker's geometry, -1: not moved."""
    geometry = scene.checker.bodies
    bodies = build_geometry(scene.robot, scene.loaded, with_bin=True)
    movable = MovableBodies(scene.robot, scene.loaded, bodies)
    numbers = [(pair.first, pair.second) for pair in geometry.collisionPairs]
    first, second = np.array(numbers, np.int64).reshape(-1, 2).T
    of_bin = movable.is_bin[first] | movable.is_bin[second]
    of_tool = movable.is_tool[first] | movable.is_tool[second]
    kind = np.where(of_bin, np.where(of_tool, 1, 0), np.where(of_tool, 2, -1))
    return np.asarray(kind, np.int64)


def replay_unit(context: Replay, unit: PerturbedCell) -> BoolArray:
    """Whether each of some paths stays free in a perturbed cell, shape (rows,)."""
    stored = context.stored[unit.filling]
    motions = motions_in(stored.loaded, unit.misplacement, context.margin_m)
    return np.array(
        [motions.path_is_verified(stored.paths[row]) for row in unit.rows], bool
    )


def motions_in(
    loaded: LoadedCell, misplacement: Misplacement, margin_m: float
) -> MotionChecker:
    """Checks of motions in a perturbed cell."""
    robot = RobotModel.from_cell(loaded)
    bodies = build_geometry(robot, loaded, with_bin=True)
    moved = MovableBodies(robot, loaded, bodies).moved(misplacement)
    collision = loaded.cell.collision
    return MotionChecker(
        CollisionChecker(robot, moved, margin_m),
        collision.planning_step_rad,
        min(collision.verification_distance_m, SPACING_M),
    )


def is_covered(
    clearance_m: FloatArray, bin_m: float, tool_m: float, margin_m: float
) -> BoolArray:
    """Whether clearances cover how far errors move bodies, (n, kinds) to (n,).

    Parameters
    ----------
    clearance_m : array, shape (n, kinds)
        Certain clearance by kind of pair, see ``MOVED`` [m].
    bin_m, tool_m : float
        How far errors move a point of the bin and of the tool, at most [m].
    margin_m : float
        Clearance that must be left.
    """
    moved: Sequence[float] = (bin_m, bin_m + tool_m, tool_m)
    # Kinds of pairs that nothing moves keep the clearance they have.
    needed = np.array([m + margin_m if m > 0 else -np.inf for m in moved])
    return np.asarray((clearance_m > needed).all(axis=1))
