"""The cell in the viewer: solids, points, labels, in robot_base."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray
from reachmap.cell.model.shapes import triangles_of
from reachmap.core.collision.held_part import HeldPart
from reachmap.core.collision.solids import Solid, SolidCell
from reachmap.geometry import quaternion_wxyz_from_rotation, transform_points
from reachmap.plots.cell.cell_colours import BIN, BLOCKING, solid_colours
from reachmap.plots.parts.style import NOT_ATTEMPTED, colour_map
from reachmap.view.points import MapPoints

if TYPE_CHECKING:
    import viser

# Edges sharper than 34 degrees stay edges; drums of arms are shaded round.
CREASE_RAD = 0.6
# Walls and floors that would hide the arm are seen through.
LARGE_BODY_M = 1.5
GLASS = 0.16
PART = (214, 138, 60)


def percent_colours(percent: FloatArray) -> CodeArray:
    """Colours from red (0 %) to green (100 %), grey for NaN, (n,) to uint8 (n, 3)."""
    rgba = colour_map("RdYlGn")(np.ma.masked_invalid(percent) / 100.0)
    rgb = np.round(255.0 * np.asarray(rgba)[:, :3]).astype(np.uint8)
    rgb[np.isnan(percent)] = [int(NOT_ATTEMPTED[i : i + 2], 16) for i in (1, 3, 5)]
    return rgb


class Stage:
    """Draws a cell and the points of a map, and moves the arm.

    Parameters
    ----------
    server : viser.ViserServer
    cell : SolidCell
    glass_bin : bool
        See through the bin: it was not among the obstacles.
    """

    def __init__(
        self, server: viser.ViserServer, cell: SolidCell, *, glass_bin: bool = False
    ) -> None:
        self.scene: Any = server.scene
        self.cell = cell
        self._glass_bin = glass_bin
        self._colours = solid_colours(cell.solids)
        self._joints = [
            self.scene.add_frame(f"/cell/joint_{k}", show_axes=False)
            for k in range(cell.robot.dof + 1)
        ]
        self._meshes = [
            (solid.name, self._add_solid(index, solid))
            for index, solid in enumerate(cell.solids)
        ]
        self._part = HeldPart.of(cell.loaded)
        self._part_mesh: Any = None
        self._red: frozenset[str] = frozenset()
        self._last = np.full((len(self._joints), 4, 4), np.nan)
        self._add_camera()
        self.take(cell.scan_configuration)
        self._place_viewer(server)

    def take(self, q: FloatArray, part_at: FloatArray | None = None) -> None:
        """Put the arm into a configuration (dof,) [rad].

        Parameters
        ----------
        q : array, shape (dof,)
        part_at : array, shape (dof,), optional
            Configuration whose tool determines the part's pose; None hides the part.
        """
        self._put_part(part_at)
        poses = self.cell.joint_poses(q)
        for handle, T, before in zip(self._joints, poses, self._last, strict=True):
            if not np.allclose(T, before, atol=1e-7, equal_nan=False):
                handle.position = T[:3, 3]
                handle.wxyz = quaternion_wxyz_from_rotation(T[:3, :3])
        self._last = poses

    def _put_part(self, q: FloatArray | None) -> None:
        """Show the part where the tool of a configuration holds it, or hide it."""
        part = self._part
        if part is None or (q is None and self._part_mesh is None):
            return
        if self._part_mesh is None:
            surface = triangles_of(part.solid)
            solid = Solid(
                name="part",
                kind="body",
                joint=0,
                T_joint_solid=np.eye(4),
                vertices=surface.vertices,
                triangles=surface.triangles,
            )
            self._part_mesh = self._mesh("/part", solid, np.eye(4), PART, opacity=None)
        self._part_mesh.visible = q is not None
        if q is not None:
            T = self.cell.tcp_pose(q) @ part.T_tcp_part
            self._part_mesh.position = T[:3, 3]
            self._part_mesh.wxyz = quaternion_wxyz_from_rotation(T[:3, :3])

    def redden(self, names: Iterable[str] = ()) -> None:
        """Show some bodies in red, by name, and all others in their colours."""
        red = frozenset(names)
        for name, mesh in self._meshes:
            if (name in red) != (name in self._red):
                mesh.color = BLOCKING if name in red else self._colours[name]
        self._red = red

    def put_points(
        self,
        points: MapPoints,
        shown: IntArray,
        percent: FloatArray,
        *,
        name: str = "/points",
        scale: float = 1.0,
        visible: bool = True,
    ) -> Any:
        """Draw points of a map as spheres; return the handle, None without points."""
        if not len(shown):
            return None
        vertices, triangles = _ball()
        turned = np.tile([1.0, 0.0, 0.0, 0.0], (len(shown), 1))
        return self.scene.add_batched_meshes_simple(
            name,
            vertices=(vertices * points.size_m * scale).astype(np.float32),
            faces=triangles,
            batched_wxyzs=turned.astype(np.float32),
            batched_positions=points.position[shown].astype(np.float32),
            batched_colors=_linear(percent_colours(percent[shown])),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=visible,
        )

    def put_runner_up(self, T_base_bin: FloatArray) -> None:
        """Draw the bin once more, as a glass one, where the runner-up has it."""
        own = next(iter([s for s in self.cell.solids if s.kind == "bin"]), None)
        if own is None:
            return
        T_base_own = self.cell.loaded.cell.T_base_bin()
        T_there = T_base_bin @ np.linalg.inv(T_base_own)
        poses = self.cell.solid_poses(self.cell.scan_configuration)
        for index, solid in enumerate(self.cell.solids):
            if solid.kind == "bin":
                self._mesh(
                    f"/runner_up/{index}",
                    solid,
                    T_there @ poses[index],
                    BIN,
                    opacity=0.22,
                )

    def put_way(self, points: FloatArray, *, name: str, visible: bool = True) -> Any:
        """Draw the way of the tool as a line through points (n, 3)."""
        segments = np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)
        return self.scene.add_line_segments(
            name,
            points=segments,
            colors=(232, 131, 42),
            thickness=3.0,
            thickness_units="screen",
            visible=visible,
        )

    def put_axes(self, T_base_frame: FloatArray | None) -> None:
        """Draw the axes of a frame, or remove them."""
        if T_base_frame is None:
            self.scene.add_frame("/frame", visible=False)
            return
        self.scene.add_frame(
            "/frame",
            axes_length=0.07,
            axes_radius=0.003,
            origin_radius=0.005,
            position=T_base_frame[:3, 3],
            wxyz=quaternion_wxyz_from_rotation(T_base_frame[:3, :3]),
        )

    def put_label(self, text: str, *, name: str, visible: bool = True) -> Any:
        """Write a line above the cell."""
        return self.scene.add_label(
            name,
            text,
            position=self._top,
            anchor="bottom-center",
            visible=visible,
        )

    def _add_solid(self, index: int, solid: Solid) -> Any:
        size = float(np.ptp(solid.vertices, axis=0).max(initial=0.0))
        glass = solid.kind == "body" and size > LARGE_BODY_M
        glass |= solid.kind == "bin" and self._glass_bin
        return self._mesh(
            f"/cell/joint_{solid.joint}/solid_{index}",
            solid,
            solid.T_joint_solid,
            self._colours[solid.name],
            opacity=GLASS if glass else None,
        )

    def _mesh(
        self,
        name: str,
        solid: Solid,
        T: FloatArray,
        colour: tuple[int, int, int],
        opacity: float | None,
    ) -> Any:
        vertices, triangles = _split_at_creases(solid)
        return self.scene.add_mesh_simple(
            name,
            vertices=vertices.astype(np.float32),
            faces=triangles.astype(np.uint32),
            color=colour,
            opacity=opacity,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            position=T[:3, 3],
            wxyz=quaternion_wxyz_from_rotation(T[:3, :3]),
        )

    def _add_camera(self) -> None:
        frame, spec = self.cell.camera_frame(), self.cell.loaded.cell.camera
        if frame is None or spec is None:
            return
        joint, T = frame
        across, down = np.radians(spec.field_of_view_deg)
        self.scene.add_camera_frustum(
            f"/cell/joint_{joint}/camera",
            fov=float(down),
            aspect=float(np.tan(across / 2.0) / np.tan(down / 2.0)),
            scale=0.05,
            thickness=1.4,
            thickness_units="screen",
            color=(90, 90, 90),
            position=T[:3, 3],
            wxyz=quaternion_wxyz_from_rotation(T[:3, :3]),
        )

    def _place_viewer(self, server: viser.ViserServer) -> None:
        """Look at the arm and the bin from in front and above."""
        poses = self.cell.solid_poses(self.cell.scan_configuration)
        corners = np.concatenate(
            [
                transform_points(T, solid.vertices)
                for solid, T in zip(self.cell.solids, poses, strict=True)
                if solid.kind != "body"
            ]
        )
        low, high = corners.min(axis=0), corners.max(axis=0)
        middle, size = (low + high) / 2.0, float(np.linalg.norm(high - low))
        self._top = np.array([middle[0], middle[1], high[2] + 0.03 * size])
        towards = np.array([0.78, -0.78, 0.55])
        camera = server.initial_camera
        camera.fov = float(np.radians(45.0))
        # A little below the middle: the label is above, the bin below.
        aim = middle - np.array([0.0, 0.0, 0.03 * size])
        camera.look_at = aim
        camera.position = aim + 1.10 * size * towards


def _split_at_creases(solid: Solid) -> tuple[FloatArray, IntArray]:
    """Vertices and triangles whose corners are shared only where a surface is round."""
    import trimesh

    mesh = trimesh.Trimesh(solid.vertices, solid.triangles, process=False)
    smooth = trimesh.graph.smooth_shade(mesh, angle=CREASE_RAD)
    return np.asarray(smooth.vertices, float), np.asarray(smooth.faces, np.int64)


def _linear(rgb: CodeArray) -> CodeArray:
    """Turn sRGB into linear light, in which the viewer reads colours of instances."""
    share = rgb.astype(float) / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.round(255.0 * light).astype(np.uint8))


def _ball() -> tuple[FloatArray, IntArray]:
    """Unit sphere, coarse enough for small points."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    return np.asarray(ball.vertices, float), np.asarray(ball.faces, np.uint32)
