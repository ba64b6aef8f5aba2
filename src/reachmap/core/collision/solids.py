"""The cell as triangles with names, for pictures: what is shown is what is checked.

The shapes are the collision shapes, of links and of bodies alike, so a picture
of two bodies in contact shows why a configuration was refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import coal
import numpy as np
import pinocchio as pin
from scipy.spatial import ConvexHull

from reachmap._typing import FloatArray, IntArray
from reachmap.core.collision.bodies import build_geometry
from reachmap.core.robot.model import RobotModel

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

Triangles: TypeAlias = tuple[FloatArray, IntArray]
ROUND_STEPS = 48


def box_triangles(sides: FloatArray) -> Triangles:
    """Centred box with full sides (3,) [m]; faces share no corners.

    Returns
    -------
    vertices : array, shape (24, 3)
    triangles : int array, shape (12, 3)
        Indices of vertices, counter-clockwise seen from outside.
    """
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    faces = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            face = np.empty((4, 3))
            face[:, axis] = sign
            # Running backwards turns the face to the other side.
            face[:, [(axis + 1) % 3, (axis + 2) % 3]] = square[:: int(sign)]
            faces.append(face)
    vertices = np.concatenate(faces) * np.asarray(sides, float) / 2.0
    corner = 4 * np.arange(6)[:, None, None]
    triangles = corner + np.array([[0, 1, 2], [0, 2, 3]])
    return vertices, np.asarray(triangles.reshape(-1, 3), np.int64)


def revolved_triangles(profile: FloatArray, steps: int = ROUND_STEPS) -> Triangles:
    """Surface of revolution about z.

    Parameters
    ----------
    profile : array, shape (n, 2)
        Radius and height of points from the lower end to the upper one [m]; the first
        and the last lie on the axis.
    steps : int
        Corners of each ring.

    Returns
    -------
    vertices : array, shape (n * steps, 3)
    triangles : int array, shape (m, 3)
    """
    angle = np.linspace(0.0, 2.0 * np.pi, steps, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(steps)], axis=-1)
    up = np.array([0.0, 0.0, 1.0])
    vertices = np.concatenate([r * ring + z * up for r, z in profile])
    here = np.arange(steps)
    there = (here + 1) % steps
    strips = []
    for low in range(len(profile) - 1):
        a, b = steps * low, steps * (low + 1)
        if profile[low, 0] > 0:
            strips.append(np.stack([a + here, a + there, b + there], axis=-1))
        if profile[low + 1, 0] > 0:
            strips.append(np.stack([a + here, b + there, b + here], axis=-1))
    return vertices, np.asarray(np.concatenate(strips), np.int64)


def cylinder_triangles(radius: float, length: float) -> Triangles:
    """Centred cylinder about z; caps and side share no corners."""
    half = length / 2.0
    # Rings that occur twice keep the edges of the caps sharp.
    profile = [(0, -half), (radius, -half), (radius, -half)]
    profile += [(radius, half), (radius, half), (0, half)]
    return revolved_triangles(np.array(profile, float))


def capsule_triangles(radius: float, length: float) -> Triangles:
    """Cylinder about z with two half-spheres; ``length`` is without them."""
    angle = np.linspace(0.0, np.pi / 2.0, ROUND_STEPS // 4 + 1)
    cap = radius * np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    cap[0, 0] = 0.0
    lower = cap * [1.0, -1.0] - np.array([0.0, length / 2.0])
    upper = np.array([0.0, length / 2.0]) + cap[::-1]
    return revolved_triangles(np.concatenate([lower, upper]))


Kind: TypeAlias = Literal["link", "tool", "body", "bin"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solid:
    """One rigid shape.

    Attributes
    ----------
    name : str
        As in ``body_pairs``; a link with several shapes has several solids.
    kind : {"link", "tool", "body", "bin"}
        A tool is a body that the arm carries, a body stands still.
    joint : int
        Joint that carries it, 0 for what stands still.
    T_joint_solid : array, shape (4, 4)
    vertices : array, shape (n, 3)
        In the solid's own frame [m].
    triangles : int array, shape (m, 3)
    """

    name: str
    kind: Kind
    joint: int
    T_joint_solid: FloatArray
    vertices: FloatArray = field(repr=False)
    triangles: IntArray = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolidCell:
    """All solids of a cell, and where they are at a configuration.

    Attributes
    ----------
    loaded : LoadedCell
    robot : RobotModel
    solids : tuple of Solid
    scan_configuration : array, shape (dof,)
        [rad].
    """

    loaded: LoadedCell = field(repr=False)
    robot: RobotModel
    solids: tuple[Solid, ...]
    scan_configuration: FloatArray

    @classmethod
    def build(cls, loaded: LoadedCell) -> SolidCell:
        """Load the shapes of a cell, bin included.

        Raises
        ------
        SceneError
            A frame, joint or mesh cannot be used.
        """
        robot = RobotModel.from_cell(loaded)
        bodies = build_geometry(robot, loaded, with_bin=True)
        own = {body.name for body in loaded.cell.bodies}
        solids = []
        for name, shape in zip(
            bodies.names, bodies.geometry.geometryObjects, strict=True
        ):
            vertices, triangles = _triangles_of(shape.geometry)
            solids.append(
                Solid(
                    name=name,
                    kind=_kind(name, int(shape.parentJoint), own),
                    joint=int(shape.parentJoint),
                    T_joint_solid=np.array(shape.placement.homogeneous),
                    vertices=vertices,
                    triangles=triangles,
                )
            )
        return cls(
            loaded=loaded,
            robot=robot,
            solids=tuple(solids),
            scan_configuration=robot.configuration(
                loaded.scan_configuration_rad, "scan_configuration"
            ),
        )

    def joint_poses(self, q: FloatArray) -> FloatArray:
        """Poses of all joints in robot_base, shape (dof + 1, 4, 4); 0 is the root."""
        data = self.robot.model.createData()
        pin.forwardKinematics(self.robot.model, data, np.asarray(q, float))
        poses = np.array([placement.homogeneous for placement in data.oMi])
        return np.asarray(self.robot.T_base_root @ poses)

    def solid_poses(self, q: FloatArray) -> FloatArray:
        """Poses of all solids in robot_base, shape (solids, 4, 4)."""
        joints = self.joint_poses(q)
        return np.array([joints[s.joint] @ s.T_joint_solid for s in self.solids])

    def tcp_pose(self, q: FloatArray) -> FloatArray:
        """T_base_tcp, shape (4, 4)."""
        joint = self.joint_poses(q)[self.robot.tcp_joint]
        return np.asarray(joint @ self.robot.T_joint_tcp)

    def camera_frame(self) -> tuple[int, FloatArray] | None:
        """Joint that carries the camera, and its optical frame there (4, 4)."""
        camera = self.loaded.cell.camera
        if camera is None:
            return None
        joint, T_joint_parent = self.robot.frame_placement(camera.parent)
        return joint, T_joint_parent @ camera.matrix()


def _kind(name: str, joint: int, own: set[str]) -> Kind:
    if name in own:
        return "tool" if joint else "body"
    return "bin" if name.startswith("bin ") and joint == 0 else "link"


def _triangles_of(shape: Any) -> Triangles:
    if isinstance(shape, coal.BVHModelBase):
        corners = [shape.tri_indices(k) for k in range(shape.num_tris)]
        triangles = np.array([[t[0], t[1], t[2]] for t in corners], np.int64)
        return np.asarray(shape.vertices(), float), triangles.reshape(-1, 3)
    if isinstance(shape, coal.Box):
        return box_triangles(2.0 * np.asarray(shape.halfSide).ravel())
    if isinstance(shape, coal.Cylinder):
        return cylinder_triangles(shape.radius, 2.0 * shape.halfLength)
    if isinstance(shape, coal.Capsule):
        return capsule_triangles(shape.radius, 2.0 * shape.halfLength)
    if isinstance(shape, coal.Sphere):
        return capsule_triangles(shape.radius, 0.0)
    if isinstance(shape, coal.ConvexBase):
        points = np.array([shape.point(k) for k in range(shape.num_points)], float)
        return points, np.asarray(ConvexHull(points).simplices, np.int64)
    return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
