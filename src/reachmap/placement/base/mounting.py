"""Mountings of an arm, and the meaning of a base pose in each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.base_pose import turned_about_y, with_base_at, with_joint_at
from reachmap.core.scene import Scene
from reachmap.geometry import inverse_transform, tilt_rad, yaw_transform
from reachmap.placement.mapped.exact import Pose

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

LEANS_DEG = {"floor": 0.0, "wall": 90.0, "ceiling": 180.0}
AS_IT_IS = "as it is"
# Leans are the same within this [rad].
SAME = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounting:
    """A base that can be put to x, y, z and turned about the vertical by yaw.

    Attributes
    ----------
    name : str
        As it was asked for.
    lean : tuple of tuple
        R_level_base at yaw 0.
    stands : tuple of str
        Bodies on the world that go with the base.
    """

    name: str
    lean: tuple[tuple[float, ...], ...]
    stands: tuple[str, ...]

    @classmethod
    def of(cls, name: str, R_own: FloatArray, stands: tuple[str, ...]) -> Mounting:
        """Mounting by name or lean [deg], the cell's own where it leans alike.

        Parameters
        ----------
        name : str
        R_own : array, shape (3, 3)
            R_level_base of the cell as it is.
        stands : tuple of str
        """
        lean = R_own
        if name != AS_IT_IS:
            degrees = LEANS_DEG[name] if name in LEANS_DEG else float(name)
            if abs(tilt_rad(R_own) - np.radians(degrees)) > SAME:
                lean = turned_about_y(degrees)
        rows = tuple(tuple(row) for row in (np.round(lean, 12) + 0.0).tolist())
        return cls(name=name, lean=rows, stands=stands)

    def T_level_base(self, pose: Pose) -> FloatArray:  # noqa: N802
        """The base at a pose, shape (4, 4)."""
        T = yaw_transform(*pose)
        T[:3, :3] = T[:3, :3] @ np.array(self.lean)
        return T

    def cell_at(self, loaded: LoadedCell, pose: Pose) -> LoadedCell:
        """The cell with the base at a pose; its world is the level frame."""
        return with_base_at(loaded, self.T_level_base(pose), self.stands)

    def final(
        self, loaded: LoadedCell, pose: Pose, T_world_level: FloatArray
    ) -> LoadedCell:
        """The same of the cell in its own world."""
        return with_base_at(
            loaded, T_world_level @ self.T_level_base(pose), self.stands
        )

    def scene(self, loaded: LoadedCell) -> Scene:
        """A scene whose world moves against the arm."""
        return Scene.build(loaded, with_bin=True, world_moves=True)

    def at(self, scene: Scene, loaded: LoadedCell) -> Scene:
        """Self-collision and kinematics stay; the world is moved."""
        return scene.with_world_of(loaded)


@dataclass(frozen=True, slots=True, kw_only=True)
class RailMounting:
    """An arm on a rail: x of a pose is the position of a locked prismatic joint [m]."""

    name: str

    def cell_at(self, loaded: LoadedCell, pose: Pose) -> LoadedCell:
        """The cell with the joint locked there."""
        return with_joint_at(loaded, self.name, round(pose[0], 9))

    def final(
        self, loaded: LoadedCell, pose: Pose, T_world_level: FloatArray
    ) -> LoadedCell:
        """The same of the cell in its own world."""
        return self.cell_at(loaded, pose)

    def scene(self, loaded: LoadedCell) -> Scene:
        """The scene as the cell is."""
        return Scene.build(loaded, with_bin=True)

    def at(self, scene: Scene, loaded: LoadedCell) -> Scene:
        """A new scene, since the arm differs."""
        return Scene.build(loaded, with_bin=True)


AnyMounting = Mounting | RailMounting


def own_pose(T_level_base: FloatArray) -> Pose:
    """Pose of the base as it is: yaw counts from there."""
    x, y, z = (round(float(v), 9) + 0.0 for v in T_level_base[:3, 3])
    return (x, y, z, 0.0)


def T_level_base_of(loaded: LoadedCell, T_world_level: FloatArray) -> FloatArray:  # noqa: N802
    """The base of a cell in the level frame, shape (4, 4)."""
    T_world_base = loaded.cell.robot.base_pose.matrix()
    return np.asarray(inverse_transform(T_world_level) @ T_world_base)
