"""The arm: a Pinocchio model of the joints that move, with limits and frames.

Frames: *root* is the link the URDF starts at (Pinocchio's universe), *base* is the
cell's ``robot_base``, *tcp* the tool centre point. Poses given to and taken from users
are in *base*.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.model.cell import IkSpec, RobotSpec
from reachmap.core.robot.assembly import (
    BaseToTip,
    add_tcp,
    find_frame,
    following,
    locked_positions,
    model_from_text,
    moving_joints,
    reduced_model,
    with_followers,
)
from reachmap.core.robot.joints import read_urdf_joints
from reachmap.errors import SceneError
from reachmap.geometry import inverse_transform

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobotModel:
    """The moving joints of a robot, from its base to its TCP.

    Attributes
    ----------
    model : pinocchio.Model
        Joints that do not move are locked and gone; ``nq == nv == dof``, and the
        TCP is its frame ``reachmap_tcp``.
    body_model : pinocchio.Model
        What carries bodies: the joints of `model`, then those beside the chain that
        follow one of them (gas springs, parallelograms, fingers).
    following : array, shape (followers, dof)
    following_offset : array, shape (followers,)
        Positions of the followers are ``following @ q + following_offset``.
    joint_names : tuple of str
        In the order of a configuration.
    is_revolute : array of bool, shape (dof,)
    lower_rad, upper_rad : array, shape (dof,)
        Position limits [rad] ([m] for prismatic joints).
    velocity_rad_s, acceleration_rad_s2, jerk_rad_s3 : array, shape (dof,)
        With the cell's scaling; a jerk that nothing limits is infinite.
    base_frame : str
        URDF frame called ``robot_base``.
    ik : IkSpec
        How the cell wants inverse kinematics solved.
    T_root_base, T_base_root : array, shape (4, 4)
        robot_base in the root link, and the inverse.
    T_world_base : array, shape (4, 4)
        robot_base in the cell's world.
    T_root_world : array, shape (4, 4)
        The cell's world in the root link.
    tcp_joint : int
        Index in `model` of the joint that carries the TCP.
    T_joint_tcp : array, shape (4, 4)
        TCP in the frame of that joint.
    """

    model: Any = field(repr=False)
    body_model: Any = field(repr=False)
    following: FloatArray
    following_offset: FloatArray
    joint_names: tuple[str, ...]
    is_revolute: BoolArray
    lower_rad: FloatArray
    upper_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    jerk_rad_s3: FloatArray
    base_frame: str
    ik: IkSpec
    T_root_base: FloatArray
    T_base_root: FloatArray = field(init=False)
    T_world_base: FloatArray
    T_root_world: FloatArray = field(init=False)
    tcp_joint: int
    T_joint_tcp: FloatArray

    def __post_init__(self) -> None:
        T_base_world = inverse_transform(self.T_world_base)
        object.__setattr__(self, "T_base_root", inverse_transform(self.T_root_base))
        object.__setattr__(self, "T_root_world", self.T_root_base @ T_base_world)
        for name in type(self).__slots__:
            value = getattr(self, name)
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @classmethod
    def from_cell(cls, loaded: LoadedCell) -> RobotModel:
        """Build the arm of a cell.

        Raises
        ------
        SceneError
            A frame or joint is unknown, a limit is missing, or the chain from base
            to TCP cannot be used; one line per mistake, with its place in the file.
        """
        try:
            return cls.from_spec(loaded.cell.robot, urdf=loaded.urdf)
        except SceneError as error:
            raise SceneError(
                f"{loaded.place_of(line.partition(':')[0])}: {line}"
                for line in error.lines
            ) from error

    @classmethod
    def from_spec(cls, spec: RobotSpec, *, urdf: str) -> RobotModel:
        """Build an arm from its description and its URDF.

        Parameters
        ----------
        spec : RobotSpec
            With ``group`` and ``joint_limits`` written out, as in a loaded cell.
        urdf : str
            Text, xacro already expanded.

        Raises
        ------
        SceneError
            See `from_cell`.
        """
        description = read_urdf_joints(urdf)
        full = model_from_text(description.text)
        chain = BaseToTip.between(full, spec.base_frame, spec.tcp.parent)
        moving = moving_joints(full, spec, description, chain.joints)
        q_locked = locked_positions(full, spec, description)
        model, limits = reduced_model(full, moving, q_locked, description, spec.limits)
        followers = {
            name: follower
            for name, follower in description.followers.items()
            if follower.leader in moving and name not in spec.locked_joints_deg
        }
        body_model = with_followers(full, model, q_locked, followers)
        names = list(body_model.names)[len(moving) + 1 :]
        matrix, offset = following(moving, [(n, followers[n]) for n in names])
        tcp = add_tcp(model, spec)
        root_base = model.frames[
            find_frame(model, chain.base, "robot.base_frame")
        ].placement
        return cls(
            model=model,
            body_model=body_model,
            following=matrix,
            following_offset=offset,
            joint_names=tuple(moving),
            is_revolute=np.array(
                [description.joints[n].type != "prismatic" for n in moving]
            ),
            lower_rad=limits.lower,
            upper_rad=limits.upper,
            velocity_rad_s=limits.velocity,
            acceleration_rad_s2=limits.acceleration,
            jerk_rad_s3=limits.jerk,
            base_frame=chain.base,
            ik=spec.ik,
            T_root_base=np.array(root_base.homogeneous),
            T_world_base=spec.base_pose.matrix(),
            tcp_joint=int(tcp.parentJoint),
            T_joint_tcp=np.array(tcp.placement.homogeneous),
        )

    @property
    def dof(self) -> int:
        """Number of joints that move."""
        return len(self.joint_names)

    def frame_placement(self, name: str) -> tuple[int, FloatArray]:
        """Where a frame is fixed.

        Parameters
        ----------
        name : str
            ``world``, ``robot_base`` or a URDF frame. The first two are the cell's,
            even if the URDF has links of these names.

        Returns
        -------
        joint : int
            Index in `body_model` of the joint that carries the frame, 0 for the root.
        T_joint_frame : array, shape (4, 4)

        Raises
        ------
        SceneError
            The URDF has no such frame.
        """
        if name == "world":
            return 0, self.T_root_world
        if name == "robot_base":
            return 0, np.array(self.T_root_base)
        return self.link_placement(name)

    def link_placement(self, name: str) -> tuple[int, FloatArray]:
        """Where a frame of the URDF is fixed, whatever it is called."""
        frame = self.body_model.frames[find_frame(self.body_model, name, "frame")]
        return int(frame.parentJoint), np.array(frame.placement.homogeneous)

    def body_configuration(self, q: FloatArray) -> FloatArray:
        """Positions of the joints of `body_model`, (dof,) to (dof + followers,)."""
        if not len(self.following):
            return q
        return np.concatenate([q, self.following @ q + self.following_offset])

    def configuration(self, values: Mapping[str, float], where: str) -> FloatArray:
        """Joint vector from values by joint name, shape (dof,).

        Parameters
        ----------
        values : mapping
            Position of each joint [rad or m].
        where : str
            Place in the cell, for the message.

        Raises
        ------
        SceneError
            A joint is missing or unknown.
        """
        missing = [n for n in self.joint_names if n not in values]
        unknown = sorted(set(values) - set(self.joint_names))
        problems = []
        if missing:
            problems.append(f"{where}: no value for {', '.join(missing)}")
        if unknown:
            problems.append(
                f"{where}: {', '.join(unknown)} "
                f"do(es) not move (joints: {', '.join(self.joint_names)})"
            )
        if problems:
            raise SceneError(problems)
        return np.array([values[n] for n in self.joint_names], float)

    def outside_limits(self, q: FloatArray) -> tuple[str, ...]:
        """Names of the joints that a configuration puts outside their limits."""
        outside = (q < self.lower_rad) | (q > self.upper_rad)
        return tuple(
            name for name, out in zip(self.joint_names, outside, strict=True) if out
        )
