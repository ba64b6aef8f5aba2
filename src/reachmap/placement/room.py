"""Whether a bin leaves room for parts that are put down, and picked from others."""

from __future__ import annotations

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.model.bodies import BinSpec
from reachmap.cell.model.cell import Cell, DropOffSpec
from reachmap.cell.model.shapes import ConvexBody
from reachmap.core.collision.bin_fit import ToolFit
from reachmap.core.collision.bodies import ROOT
from reachmap.core.collision.shapes import coal_shape
from reachmap.core.collision.static_bodies import PlacedBody, box_around
from reachmap.core.scene import Scene
from reachmap.geometry import (
    approach_directions,
    axis_vector,
    inverse_transform,
    transform_points,
)
from reachmap.sampling.frames import approach_distance_m, bin_test_frames
from reachmap.scans.cycle.places import drop_off_poses


class DropOffRoom:
    """The tool with the part at the drop-offs of a cell.

    A bin leaves room where the tool can be at each drop-off, and where its straight
    approach begins, in one of the equivalent poses. The arm is left out: how it gets
    there is for the cycle to say. A drop-off in the bin itself moves with it, and one
    in a bin that is not there yet has no place.

    Parameters
    ----------
    scene : Scene
        Without the bin.
    """

    def __init__(self, scene: Scene) -> None:
        cell = scene.loaded.cell
        self._tool = ToolFit(scene.robot, scene.loaded, load="carried", whole=True)
        still = {"world", "robot_base", *cell.bins, *(b.name for b in cell.bodies)}
        self._poses = {
            spec.name: _poses(scene, spec)
            for spec in cell.drop_offs
            if spec.pose is None or spec.frame in still
        }

    def taken(self, T_base_bin: FloatArray) -> str:
        """Name of the first drop-off that a bin at a pose (4, 4) takes up, or ""."""
        T_bin_base = inverse_transform(T_base_bin)
        for name, T in self._poses.items():
            blocked = self._tool.blocked((T_bin_base @ T).reshape(-1, 4, 4))
            if blocked.reshape(T.shape[:2]).any(axis=1).all():
                return name
        return ""


def _poses(scene: Scene, spec: DropOffSpec) -> FloatArray:
    """T_base_tcp when the part is released and before, shape (equivalent, 2, 4, 4)."""
    cell = scene.loaded.cell
    if spec.pose is None:
        values = scene.loaded.joint_values_rad(spec)
        q = scene.robot.configuration(values, f"drop_off {spec.name}")
        released = scene.kinematics.forward(q)[None]
    else:
        released = drop_off_poses(cell, spec)
    before = np.eye(4)
    axis = axis_vector(cell.robot.tcp.approach_axis)
    before[:3, 3] = -spec.approach_distance_m * axis
    return np.stack([released, released @ before], axis=1)


class PickRoom:
    """The way in and out of the other bins of a cell.

    A bin leaves room where it keeps out of the other's inside and out of what the tool
    passes on its way back from there, along the mean of the approaches: above most
    bins. What a tilted tool, or the arm, would need besides is for scores to say.

    Parameters
    ----------
    scene : Scene
        Without the bin.
    """

    def __init__(self, scene: Scene) -> None:
        cell = scene.loaded.cell
        self._fit = ToolFit(scene.robot, scene.loaded, whole=True)
        length_m = self._tool_length_m(axis_vector(cell.robot.tcp.approach_axis))
        length_m += approach_distance_m(cell)
        self._names = tuple(cell.bins)
        # Bins that may touch each other need room all the same.
        self._ways = [
            PlacedBody(
                name=f"way out of {name}",
                joint=ROOT,
                shape=coal_shape(ConvexBody(points=_way_out(cell, spec, length_m))),
                T=np.eye(4),
            )
            for name, spec in cell.bins.items()
        ]

    def taken(self, T_base_bin: FloatArray) -> str:
        """Name of the first bin that one at a pose (4, 4) leaves no room, or ""."""
        hit = self._fit.first_hit(inverse_transform(T_base_bin)[None], self._ways)[0]
        return "" if hit < 0 else self._names[hit]

    def _tool_length_m(self, axis: FloatArray) -> float:
        """How far the tool reaches back from the TCP, along the approach axis (3,)."""
        ends = [box_around(body.shape, body.T) for body in self._fit.bodies]
        return max(
            (float(-(end @ axis).min()) for end in map(np.stack, ends)), default=0.0
        )


def _way_out(cell: Cell, spec: BinSpec, length_m: float) -> FloatArray:
    """Corners of a bin's inside, and of the same moved back by a length, (n, 3)."""
    T_base_bin = cell.T_base_of(spec)
    frames = bin_test_frames(cell.model_copy(update={"bin": spec}), T_base_bin).frames
    axis = cell.robot.tcp.approach_axis
    back = -approach_directions(frames.orientations, axis).mean(axis=0)
    back /= max(float(np.linalg.norm(back)), 1e-9)
    highest_m = min(max(cell.bin_scan.layers), spec.inner[2])
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) / 2.0
    inside = np.vstack(
        [
            np.column_stack([square * side, np.full(4, z)])
            for side, z in ((spec.inner[:2], 0.0), (spec.top, highest_m))
        ]
    )
    corners = transform_points(T_base_bin, inside)
    return np.vstack([corners, corners[4:] + length_m * back])
