"""Motions for live grasps from a bin map: a stored path and a verified last segment.

Nothing is planned. A grasp takes the stored path to a test grasp near it; the arm goes
on with the same branch of its kinematics to the grasp itself, by a straight joint
motion to the new pre-grasp and the straight approach, and both are checked in the cell
as planned motions are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from reachmap._typing import FloatArray
from reachmap.cell.loading import read_cell
from reachmap.core.planning.approach import StraightApproach
from reachmap.core.scene import Scene
from reachmap.errors import MapFileError, SettingsError
from reachmap.geometry import (
    axis_vector,
    direction_angle,
    rotation_from_quaternion_wxyz,
    transform_from_parts,
)
from reachmap.maps.format.bin import read_bin_map
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.records import BinMap
from reachmap.motions.motion import Motion, best_rows, timed, way_points
from reachmap.ranking.answers.cell_check import differing_sections
from reachmap.ranking.lookup.costs import outside_map
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.queries import (
    align,
    queries_from_arrays,
    rotations_from_quaternions,
)
from reachmap.ranking.lookup.settings import ALIKE_STEPS
from reachmap.ranking.lookup.table import (
    GraspTable,
    quaternion_angle,
    table_from_bin_map,
)
from reachmap.sampling.frames import approach_distance_m

# Test grasps whose paths are tried; on the shipped cell the first does for nine grasps
# of ten.
TRIES: Final = 24
NEAR_POINTS: Final = 8
# The branch is followed from the test grasp in a single step where that is as short.
LARGEST_STEP_RAD: Final = 0.8
# Where the roll is free and none of the tries will do, the nearest of them are turned.
TURNED_TRIES: Final = 3
ROLL_STEP_RAD: Final = np.radians(15.0)
ROLL_STEPS: Final = 12


@dataclass(frozen=True, kw_only=True, eq=False)  # no slots: it keeps its times
class ServedMotion:
    """A motion to one grasp from the library.

    Attributes
    ----------
    test_grasp : (int, int, int, int)
        Layer, y, x, orientation of the test grasp whose path it takes.
    T_base_tcp : array, shape (4, 4)
        Tool pose that the motion ends at.
    planned : array, shape (n, dof)
        Waypoints from the scan configuration to the pre-grasp [rad].
    approach : array, shape (m, dof)
        From the pre-grasp, which is the last of ``planned``, to the grasp [rad].
    verified : bool
        Whether what is not stored was checked in the cell.
    """

    test_grasp: tuple[int, int, int, int]
    T_base_tcp: FloatArray
    planned: FloatArray
    approach: FloatArray
    verified: bool
    _limits: tuple[FloatArray, FloatArray] = field(repr=False)

    def __repr__(self) -> str:
        how = "verified" if self.verified else "not verified"
        return f"<ServedMotion: on the path to test grasp {self.test_grasp}, {how}>"

    @cached_property
    def motion(self) -> Motion:
        """The motion with times within the limits of the joints."""
        return timed(self.planned, self.approach, self.test_grasp, *self._limits)


class MotionLibrary:
    """Serves motions to live grasps from the stored paths of a bin map.

    Its engines hold scratch data: build one for each thread.

    Parameters
    ----------
    bin_map : BinMap
    source : str
        Name of the map in messages.

    Attributes
    ----------
    table : GraspTable
    scenes : tuple of Scene
        The cell in which last pieces are checked; one for each layer where layers are
        levels of filling.
    """

    def __init__(self, bin_map: BinMap, source: str = "the map") -> None:
        self._map = bin_map
        self.table: GraspTable = table_from_bin_map(bin_map)
        loaded = cell_of_artefact(bin_map.provenance, source)
        self.scenes = tuple(Scene.build(part) for part in loaded.fillings())
        self._approaches = tuple(_approach_of(scene) for scene in self.scenes)
        rows = np.full(self.table.shape, -1)
        for place, row in best_rows(bin_map).items():
            rows[place] = row
        if not (rows >= 0).any():
            raise MapFileError(f"{source}: has no stored path")
        self._rows = rows.reshape(len(self.table.points), -1)
        robot = self.scenes[0].robot
        self._limits = robot.velocity_rad_s, robot.acceleration_rad_s2

    def __repr__(self) -> str:
        paths = int((self._rows >= 0).sum())
        sha256 = self._map.stamp.content_sha256
        return f"<MotionLibrary: map {sha256[:12]}, paths to {paths} test grasps>"

    @classmethod
    def from_map(
        cls,
        path: str | Path,
        *,
        cell: str | Path | None = None,
        overrides: Sequence[str] = (),
    ) -> MotionLibrary:
        """Load a bin map and build its cell.

        Parameters
        ----------
        path : path
        cell : path, optional
            A cell that the map must have been made for, where the bin may stand
            elsewhere: motions are those of the map's bin.
        overrides : sequence of str
            Changes to that cell.

        Raises
        ------
        MapFileError
            The file is not a readable bin map, was made for another cell or holds no
            path.
        """
        bin_map = read_bin_map(Path(path))
        if cell is not None:
            different = differing_sections(bin_map, read_cell(str(cell), overrides))
            if different:
                raise MapFileError(
                    f"{path}: was made for another cell than {cell} (different: "
                    f"{', '.join(different)}); scan again"
                )
        return cls(bin_map, str(path))

    def serve(
        self,
        point: ArrayLike,
        direction: ArrayLike | None = None,
        rotation: ArrayLike | None = None,
        *,
        quaternion_wxyz: ArrayLike | None = None,
        check: bool = True,
    ) -> ServedMotion | None:
        """Find a motion to one grasp given in robot_base.

        Parameters
        ----------
        point : array_like, shape (3,)
            [m].
        direction : array_like, shape (3,), optional
            Approach direction of a grasp whose roll is free.
        rotation, quaternion_wxyz : array_like, shape (3, 3) or (4,), optional
            Full orientation of the TCP instead.
        check : bool
            Whether the last piece is checked in the cell. Otherwise it is computed
            from the nearest test grasp alone and may collide.

        Returns
        -------
        ServedMotion or None
            None where no stored path near the grasp can be brought to it.

        Raises
        ------
        SettingsError
            It is not one grasp, or it is none.
        """
        turned = rotations_from_quaternions(quaternion_wxyz)
        query = queries_from_arrays(
            self.table,
            point,
            direction,
            rotation if turned is None else turned,
            invalid="raise",
        )
        if len(query) != 1:
            raise SettingsError(f"give one grasp at a time (got {len(query)})")
        places = self._near(query)
        for place in places:
            start = self._follow(place, query)
            served = start and self._bring(place, *start, check=check)
            if served:
                return served
        if query.free[0] and check and not self.scenes[0].kinematics.any_roll:
            return self._turned(places[:TURNED_TRIES], query)
        return None

    def _near(self, query: Queries) -> list[tuple[int, int]]:
        """Point and orientation of test grasps with a path, nearest first."""
        table = self.table
        away = np.linalg.norm(table.points - query.points[0], axis=1)
        points = np.argsort(away, kind="stable")[:NEAR_POINTS]
        if outside_map(query.points, points[:1], table)[0]:
            return []
        free = bool(query.free[0])
        if free:
            angle = direction_angle(table.axes[points], query.axes[0])
        else:
            angle = quaternion_angle(table.quaternions[points], query.quaternions[0])
        spacing = float(table.spacing_rad[0 if free else 1])
        usable = (self._rows[points] >= 0) & (angle <= ALIKE_STEPS * spacing)
        pitch = float(table.pitch_m.max())
        far = (away[points, None] / pitch) ** 2 + (angle / spacing) ** 2
        # Rolls of a direction are equally far: that of the shortest path comes first.
        length = table.means[points, :, 0]
        column, orientation = np.nonzero(usable)
        order = np.lexsort((length[usable], np.round(far[usable], 9)))[:TRIES]
        return [(int(points[column[k]]), int(orientation[k])) for k in order.tolist()]

    def _follow(
        self, place: tuple[int, int], query: Queries
    ) -> tuple[FloatArray, FloatArray] | None:
        """Tool pose of the grasp and its configuration on the branch of a path."""
        _, way = way_points(self._map, int(self._rows[place]))
        T = self._tool_pose(place, query)
        kinematics = self.scenes[self._level(place)].kinematics
        free = bool(query.free[0])
        found = kinematics.follow(
            way[-1], T[None], largest_step_rad=LARGEST_STEP_RAD, own_roll=free
        )
        if found is None:
            return None
        if free and kinematics.any_roll:
            T = kinematics.forward(found[0])
        return T, found[0]

    def _turned(
        self, places: list[tuple[int, int]], query: Queries
    ) -> ServedMotion | None:
        """Try other rolls, turning the tool away from those of test grasps."""
        turn = ROLL_STEP_RAD * axis_vector(self.table.approach_axis)
        for place in places:
            start = self._follow(place, query)
            ends = [] if start is None else [(*start, turn), (*start, -turn)]
            for _ in range(ROLL_STEPS):
                ends = [end for one in ends if (end := self._roll(place, *one))]
                for T, q, _ in ends:
                    served = self._bring(place, T, q, check=True)
                    if served:
                        return served
        return None

    def _roll(
        self, place: tuple[int, int], T: FloatArray, q: FloatArray, turn: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        R = Rotation.from_rotvec(turn).as_matrix()
        T = T @ transform_from_parts(R, np.zeros(3))
        found = self.scenes[self._level(place)].kinematics.follow(
            q, T[None], largest_step_rad=LARGEST_STEP_RAD
        )
        return None if found is None else (T, found[0], turn)

    def _level(self, place: tuple[int, int]) -> int:
        """Which of the scenes a test grasp was reached in."""
        return self._place(place)[0] if len(self.scenes) > 1 else 0

    def _place(self, place: tuple[int, int]) -> tuple[int, int, int, int]:
        layer, y, x = np.unravel_index(place[0], self.table.shape[:3])
        return int(layer), int(y), int(x), place[1]

    def _bring(
        self, place: tuple[int, int], T: FloatArray, q: FloatArray, *, check: bool
    ) -> ServedMotion | None:
        """Extend the path of a test grasp to a pose and configuration near it."""
        planned, _ = way_points(self._map, int(self._rows[place]))
        level = self._level(place)
        scene, approaches = self.scenes[level], self._approaches[level]
        approach = approaches.of(T, q)
        if approach is not None and check:
            approach = approaches.free_and_straight(approach)
        if approach is None:
            return None
        # The corner at the old pre-grasp costs a stop; the new one may do instead.
        ways = [np.vstack([planned[:-1], approach[:1]])] if len(planned) > 1 else []
        ways.append(np.vstack([planned, approach[:1]]))
        for path in ways:
            if not check or scene.motions.is_verified(path[-2], path[-1]):
                return ServedMotion(
                    test_grasp=self._place(place),
                    T_base_tcp=T,
                    planned=path,
                    approach=approach,
                    verified=check,
                    _limits=self._limits,
                )
        return None

    def _tool_pose(self, place: tuple[int, int], query: Queries) -> FloatArray:
        """T_base_tcp of the grasp, with the roll of the test grasp where it is free."""
        if query.free[0]:
            R_test = rotation_from_quaternion_wxyz(self.table.recommended[place])
            R = align(R_test, query.axes, self.table.approach_axis)[0]
        else:
            R = rotation_from_quaternion_wxyz(query.quaternions[0])
        return transform_from_parts(R, query.points[0])


def _approach_of(scene: Scene) -> StraightApproach:
    cell = scene.loaded.cell
    return StraightApproach(
        scene.kinematics,
        scene.motions,
        axis_vector(cell.robot.tcp.approach_axis),
        approach_distance_m(cell),
    )
