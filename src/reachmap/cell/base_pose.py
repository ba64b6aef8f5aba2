"""The cell with its base moved, while bin and surroundings stay in place."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.loaded import LoadedCell
from reachmap.cell.model.bodies import BodySpec
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.fields import PoseSpec, Shape
from reachmap.errors import CellError
from reachmap.geometry import (
    inverse_transform,
    quaternion_wxyz_from_rotation,
    transform_from_parts,
    upright_rotation,
)

# Poses are rounded far below what matters, so that a cell that was moved and turned
# gives the same numbers seen from its bin.
DIGITS_M, DIGITS_TURN = 9, 12
# Rounding of an axis that is meant to be vertical (1 less its z component).
UPRIGHT = 1e-6
WORLD = "world"


def base_links(loaded: LoadedCell) -> tuple[str, ...]:
    """Links that do not move relative to robot_base."""
    robot = loaded.robot
    frame = loaded.cell.robot.base_frame or robot.root
    link = frame if frame in robot.links else robot.joints[frame].child
    return tuple(robot.fixed_to(link))


def mounting_bodies(loaded: LoadedCell) -> tuple[str, ...]:
    """The mount, and bodies on the world that may touch the arm's base."""
    links, mount = set(base_links(loaded)), loaded.cell.robot.mount
    return tuple(
        body.name
        for body in loaded.cell.bodies
        if body.attach_to == WORLD
        and (links.intersection(body.touch) or (mount and body.name == mount.name))
    )


def heading_rad(R_world_base: FloatArray) -> float:
    """Heading of a base about the vertical, see :func:`upright_rotation`."""
    R = R_world_base @ upright_rotation(R_world_base)
    return float(np.arctan2(R[1, 0], R[0, 0]))


def T_world_bin_of(cell: Cell) -> FloatArray:  # noqa: N802
    """The bin in the world, shape (4, 4)."""
    return np.asarray(cell.robot.base_pose.matrix() @ cell.T_base_bin())


def with_world_at(loaded: LoadedCell, T_world_frame: FloatArray) -> LoadedCell:
    """The same cell, its poses expressed in another world frame.

    Parameters
    ----------
    loaded : LoadedCell
    T_world_frame : array, shape (4, 4)
        The new world in the old one.
    """
    T = inverse_transform(T_world_frame)
    cell = loaded.cell
    camera = cell.camera
    if camera is not None and camera.parent == WORLD:
        camera = camera.model_copy(update=_fields(T @ camera.matrix()))
    bodies = tuple(
        body.model_copy(update={"pose": pose_of(T @ body.pose.matrix())})
        if body.attach_to == WORLD
        else body
        for body in cell.bodies
    )
    base = pose_of(T @ cell.robot.base_pose.matrix())
    moved = cell.model_copy(
        update={
            "camera": camera,
            "bodies": bodies,
            "robot": cell.robot.model_copy(update={"base_pose": base, "mount": None}),
            "bin": _bin_in_world(cell, T @ T_world_bin_of(cell)),
            "workspace_scan": cell.workspace_scan.model_copy(update={"frame": WORLD}),
            "drop_off": _drop_offs_in(cell, T),
        }
    )
    return _rebuilt(loaded, moved)


def _drop_offs_in(cell: Cell, T: FloatArray) -> Any:
    """Drop-offs whose poses are in the world, seen from the new one."""
    if cell.drop_off is None:
        return None
    return tuple(
        spec.model_copy(update={"pose": pose_of(T @ spec.pose.matrix())})
        if spec.pose is not None and spec.frame == WORLD
        else spec
        for spec in cell.drop_offs
    )


def with_base_at(
    loaded: LoadedCell, T_world_base: FloatArray, stands: Collection[str]
) -> LoadedCell:
    """The cell with its base at another pose; the bin stays where it is in the world.

    Parameters
    ----------
    loaded : LoadedCell
    T_world_base : array, shape (4, 4)
    stands : collection of str
        Bodies on the world that go with the base. A box or a cylinder whose axis is
        vertical keeps its far end where it is as the base is raised or lowered.

    Raises
    ------
    CellError
        Nothing would be left of such a body.
    """
    cell = loaded.cell
    T_before = cell.robot.base_pose.matrix()
    base = pose_of(T_world_base)
    moved = cell.model_copy(
        update={
            "robot": cell.robot.model_copy(update={"base_pose": base, "mount": None}),
            "bodies": tuple(
                _carried(body, T_before, T_world_base) if body.name in stands else body
                for body in cell.bodies
            ),
            "bin": _bin_in_world(cell, T_world_bin_of(cell)),
        }
    )
    return _rebuilt(loaded, moved)


def with_joint_at(loaded: LoadedCell, joint: str, position: float) -> LoadedCell:
    """The cell with a locked joint at another position [deg; m if prismatic]."""
    locked = loaded.cell.robot.locked_joints_deg | {joint: position}
    robot = loaded.cell.robot.model_copy(update={"locked_joints_deg": locked})
    return _rebuilt(loaded, loaded.cell.model_copy(update={"robot": robot}))


def pose_of(T: FloatArray) -> PoseSpec:
    """A pose as a cell has it, rounded."""
    return PoseSpec(**_fields(T))


def _fields(T: FloatArray) -> dict[str, Any]:
    quaternion = quaternion_wxyz_from_rotation(T[:3, :3])
    return {
        "xyz": tuple((np.round(T[:3, 3], DIGITS_M) + 0.0).tolist()),
        "rpy_deg": None,
        "quaternion_wxyz": tuple((np.round(quaternion, DIGITS_TURN) + 0.0).tolist()),
    }


def _bin_in_world(cell: Cell, T_world_bin: FloatArray) -> Any:
    return cell.bin.model_copy(
        update={"frame": WORLD, "pose": pose_of(T_world_bin), "on": None}
    )


def _carried(body: BodySpec, T_before: FloatArray, T_after: FloatArray) -> BodySpec:
    """A mounting body that moves with the base; see :func:`with_base_at`."""
    T = T_after @ inverse_transform(T_before) @ body.pose.matrix()
    up = (T_after @ inverse_transform(T_before))[:3, 2]
    raised = float(T_after[2, 3] - T_before[2, 3])
    axis = _vertical_axis(body.shape, T[:3, :3])
    if axis is None or up[2] < 1.0 - UPRIGHT or raised == 0.0:
        return body.model_copy(update={"pose": pose_of(T)})
    below = body.pose.matrix()[2, 3] <= T_before[2, 3]
    grown = raised if below else -raised
    shape = _longer(body, axis, grown)
    T[2, 3] -= raised / 2.0
    return body.model_copy(update={"pose": pose_of(T), "shape": shape})


def _vertical_axis(shape: Shape, R: FloatArray) -> int | None:
    """Axis of a box or cylinder that is vertical, None where none is."""
    upright = np.flatnonzero(np.abs(R[2]) > 1.0 - UPRIGHT)
    if not len(upright):
        return None
    axis = int(upright[0])
    return axis if shape.box is not None or (shape.cylinder and axis == 2) else None


def _longer(body: BodySpec, axis: int, grown_m: float) -> Shape:
    kind, value = body.shape.kind()
    length = round((value[axis] if kind == "box" else value.length) + grown_m, DIGITS_M)
    if length <= 0.0:
        raise CellError(f"no length is left of {body.name}, whose far end stays")
    if kind == "box":
        sides = list(value)
        sides[axis] = length
        return Shape(box=(sides[0], sides[1], sides[2]))
    return Shape(cylinder=value.model_copy(update={"length": length}))


def _rebuilt(loaded: LoadedCell, cell: Cell) -> LoadedCell:
    return loaded.with_cell(cell)


def turned_about_y(degrees: float) -> FloatArray:
    """Rotation of a base whose z axis is tilted from the vertical to +x, (3, 3)."""
    angle = np.radians(degrees)
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return np.asarray(np.where(np.abs(R) < 1e-15, 0.0, R))


def level_frame(cell: Cell, *, along_world: bool) -> FloatArray:
    """Upright frame at the bin, in the world, shape (4, 4).

    Its x axis has the heading of the base, or is the world's.
    """
    R_world_base = cell.robot.base_pose.matrix()[:3, :3]
    R = np.eye(3) if along_world else R_world_base @ upright_rotation(R_world_base)
    return transform_from_parts(R, T_world_bin_of(cell)[:3, 3])
