"""A cell made ready for planning: arm, bodies, checks, scan configuration."""

from __future__ import annotations

import dataclasses
import logging
from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.robot import FREE
from reachmap.core.collision.bin_fit import misplaced_bins
from reachmap.core.collision.bodies import (
    Load,
    bin_placements,
    build_geometry,
    world_placements,
    world_shapes,
)
from reachmap.core.collision.checker import CollisionChecker
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.planning.motion import MotionChecker
from reachmap.core.planning.planner import Planner
from reachmap.core.planning.time_laws.law import TimeLaw
from reachmap.core.robot.model import RobotModel
from reachmap.errors import SceneError

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


logger = logging.getLogger(__name__)

# Distance of the points that a TCP path is measured by.
TCP_STEP_RAD = 0.02
SCAN_KEY = "scan_configuration"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """Everything that answers questions about one cell.

    Attributes
    ----------
    loaded : LoadedCell
    robot : RobotModel
    kinematics : Kinematics
    checker : CollisionChecker
    motions : MotionChecker
    planner : Planner
    time_law : TimeLaw
    scan_configuration : array, shape (dof,)
        [rad].
    T_base_bin : array, shape (4, 4)
    with_bin : bool
        Whether the bin is among the obstacles.
    load : Load
        What the tool carries.
    """

    loaded: LoadedCell = field(repr=False)
    robot: RobotModel
    kinematics: Kinematics
    checker: CollisionChecker
    motions: MotionChecker
    planner: Planner
    time_law: TimeLaw
    scan_configuration: FloatArray
    T_base_bin: FloatArray
    with_bin: bool
    load: Load = "empty"

    def __repr__(self) -> str:
        with_bin = "with its bin" if self.with_bin else "without a bin"
        return f"<Scene: {self.loaded.cell.name}, {self.robot.dof} joints, {with_bin}>"

    @classmethod
    def build(
        cls,
        loaded: LoadedCell,
        *,
        with_bin: bool = True,
        bin_moves: bool = False,
        world_moves: bool = False,
    ) -> Scene:
        """Assemble a scene.

        Parameters
        ----------
        loaded : LoadedCell
        with_bin : bool
        bin_moves : bool
            Whether :meth:`with_bin_of` will be used.
        world_moves : bool
            Whether :meth:`with_world_of` will be used.

        Raises
        ------
        SceneError
            A frame, joint or body name is unknown, or a mesh cannot be used.
        """
        cell = loaded.cell
        robot = RobotModel.from_cell(loaded)
        # Without its bin a scene is about the arm's surroundings: none of the bins.
        seen = loaded if with_bin else loaded.with_other_bins({})
        bodies = build_geometry(robot, seen, with_bin=with_bin)
        movable: dict[str, FloatArray] = {}
        if bin_moves or world_moves:
            movable |= bin_placements(robot, loaded)
        if world_moves:
            movable |= world_placements(robot, loaded)
        checker = CollisionChecker(
            robot, bodies, cell.collision.safety_margin_m, movable=movable
        )
        motions = MotionChecker(
            checker,
            cell.collision.planning_step_rad,
            cell.collision.verification_distance_m,
        )
        return cls(
            loaded=loaded,
            robot=robot,
            kinematics=Kinematics(
                robot,
                any_roll_about=(
                    cell.robot.tcp.approach_axis if cell.tool.roll == FREE else None
                ),
            ),
            checker=checker,
            motions=motions,
            planner=Planner(motions, cell.planner),
            time_law=TimeLaw(name=cell.planner.time_law, robot=robot, motions=motions),
            scan_configuration=robot.configuration(
                loaded.scan_configuration_rad, "scan_configuration"
            ),
            T_base_bin=cell.T_base_bin(),
            with_bin=with_bin,
        )

    @classmethod
    def shared(
        cls, loaded: LoadedCell, *, with_bin: bool = True, load: Load = "empty"
    ) -> Scene:
        """Scene of a cell, built once per process as long as the cell is the same.

        Raises
        ------
        SceneError
            As :meth:`build` raises it.
        """
        for scene in _shared:
            if (scene.with_bin, scene.load) == (with_bin, load) and (
                scene.loaded == loaded
            ):
                return scene
        if load == "empty":
            scene = cls.build(loaded, with_bin=with_bin)
        else:
            scene = cls.shared(loaded, with_bin=with_bin).with_load(load)
        _shared.appendleft(scene)
        return scene

    def with_load(self, load: Load) -> Scene:
        """The same scene with something else on the tool."""
        cell = self.loaded.cell
        bodies = build_geometry(
            self.robot, self.loaded, with_bin=self.with_bin, load=load
        )
        checker = CollisionChecker(self.robot, bodies, cell.collision.safety_margin_m)
        motions = MotionChecker(
            checker,
            cell.collision.planning_step_rad,
            cell.collision.verification_distance_m,
        )
        return dataclasses.replace(
            self,
            checker=checker,
            motions=motions,
            planner=Planner(motions, cell.planner),
            time_law=dataclasses.replace(self.time_law, motions=motions),
            load=load,
        )

    def with_bin_of(self, loaded: LoadedCell) -> Scene:
        """Move the bin to where a version of the cell has it.

        That takes a fraction of the time of building a scene. Everything else is
        shared: the scene that this is called on, built with ``bin_moves``, must not be
        used any more.

        Parameters
        ----------
        loaded : LoadedCell
            The same cell but for the bin's pose.
        """
        self.checker.move(bin_placements(self.robot, loaded))
        T_base_bin = loaded.cell.T_base_bin()
        return dataclasses.replace(self, loaded=loaded, T_base_bin=T_base_bin)

    def with_world_of(self, loaded: LoadedCell) -> Scene:
        """Move the bin and all that stands in the world, as :meth:`with_bin_of` does.

        Parameters
        ----------
        loaded : LoadedCell
            The same cell but for the poses of robot_base, the bin and bodies on the
            world, and the sizes of those that are primitives.
        """
        robot = dataclasses.replace(
            self.robot, T_world_base=loaded.cell.robot.base_pose.matrix()
        )
        self.checker.move(
            bin_placements(robot, loaded) | world_placements(robot, loaded),
            world_shapes(loaded),
        )
        return dataclasses.replace(
            self, loaded=loaded, robot=robot, T_base_bin=loaded.cell.T_base_bin()
        )

    def require_free_scan_configuration(self) -> None:
        """Refuse to work from a scan configuration that cannot be taken.

        What is doubtful about the cell is logged as a warning.

        Raises
        ------
        SceneError
            It is outside joint limits, or two bodies touch, or the bin reaches into
            what stands around it; they are named.
        """
        for warning in self.loaded.warnings:
            logger.warning("%s", warning)
        problems = self.scan_problems()
        if problems:
            raise SceneError(problems)

    def scan_problems(self) -> tuple[str, ...]:
        """Say why the scan configuration cannot be taken; empty where it can.

        Each problem begins with where the cell file gives what it is about.
        """
        return tuple(
            f"{self.loaded.place_of(key)}: {key}: {problem}"
            for key, problem in self._problems_by_key()
        )

    def _problems_by_key(self) -> list[tuple[str, str]]:
        q, robot = self.scan_configuration, self.robot
        problems = []
        for name in robot.outside_limits(q):
            k = robot.joint_names.index(name)
            turns = bool(robot.is_revolute[k])
            value, low, high = (
                float(np.degrees(row[k]) if turns else row[k])
                for row in (q, robot.lower_rad, robot.upper_rad)
            )
            text = (
                f"{name} = {value:.6g} {'deg' if turns else 'm'} is outside its limits "
                f"[{low:.6g}, {high:.6g}]"
            )
            problems.append((SCAN_KEY, text))
        for index in self.checker.touching_pairs(q):
            first, second = self.checker.body_pairs[index].split(" | ")
            problems.append((SCAN_KEY, f"{first} touches {second}"))
        # Bodies that stand still are not collision pairs; here they are checked.
        if self.with_bin:
            problems += [
                (f"{key}.pose", contact.pair)
                for key, contact in misplaced_bins(robot, self.loaded)
            ]
        return problems

    def tcp_path_points(self, path: FloatArray) -> FloatArray:
        """TCP positions along a joint path, shape (n, 3) [m]."""
        pieces = [path[:1]]
        for q_from, q_to in zip(path[:-1], path[1:], strict=True):
            steps = max(1, int(np.ceil(np.linalg.norm(q_to - q_from) / TCP_STEP_RAD)))
            shares = np.arange(1, steps + 1)[:, None] / steps
            pieces.append(q_from + shares * (q_to - q_from))
        return self.kinematics.forward_many(np.vstack(pieces))[:, :3, 3]


# The cell as it is, with and without the bin, and with the part on the tool.
_shared: deque[Scene] = deque(maxlen=6)
