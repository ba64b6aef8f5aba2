"""The arm: a Pinocchio model of the joints that move, with limits and frames.

Frames: *root* is the link the URDF starts at (Pinocchio's universe), *base* is the
cell's ``robot_base``, *tcp* the tool centre point. Poses given to and taken from users
are in *base*.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.model import JointLimits, RobotSpec
from reachmap.core.limits import JointRange, LimitTable, merge_limits
from reachmap.core.urdf import UrdfJoints, read_group, read_urdf_joints
from reachmap.errors import SceneError
from reachmap.geometry import inverse_transform

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

TCP_FRAME = "reachmap_tcp"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RobotModel:
    """The moving joints of a robot, from its base to its TCP.

    Attributes
    ----------
    model : pinocchio.Model
        Joints that do not move are locked and gone; ``nq == nv == dof``, and the
        TCP is its frame `TCP_FRAME`.
    urdf : str
        URDF text; link geometry is built from it and `model` with
        ``pin.buildGeomFromUrdfString``.
    package_dirs : tuple of str
        Folders in which ``package://`` names are looked up.
    joint_names : tuple of str
        In the order of a configuration.
    is_revolute : array of bool, shape (dof,)
    lower_rad, upper_rad : array, shape (dof,)
        Position limits [rad] ([m] for prismatic joints).
    velocity_rad_s, acceleration_rad_s2 : array, shape (dof,)
        With the cell's scaling.
    base_frame : str
        URDF frame called ``robot_base``.
    T_root_base : array, shape (4, 4)
    T_world_base : array, shape (4, 4)
    tcp_joint : int
        Index in `model` of the joint that carries the TCP.
    T_joint_tcp : array, shape (4, 4)
        TCP in the frame of that joint.
    """

    model: Any = field(repr=False)
    urdf: str = field(repr=False)
    package_dirs: tuple[str, ...]
    joint_names: tuple[str, ...]
    is_revolute: BoolArray
    lower_rad: FloatArray
    upper_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    base_frame: str
    T_root_base: FloatArray
    T_world_base: FloatArray
    tcp_joint: int
    T_joint_tcp: FloatArray

    def __post_init__(self) -> None:
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
            to TCP cannot be used; one line per mistake.
        """
        return cls.from_spec(
            loaded.cell.robot,
            urdf=loaded.urdf,
            srdf=loaded.srdf,
            package_dirs=[str(folder) for folder in loaded.package_dirs],
            moveit_limits=loaded.joint_limits,
        )

    @classmethod
    def from_spec(
        cls,
        spec: RobotSpec,
        *,
        urdf: str,
        srdf: str = "",
        package_dirs: Sequence[str] = (),
        moveit_limits: Mapping[str, Any] | None = None,
    ) -> RobotModel:
        """Build an arm from its description and the texts of its files.

        Parameters
        ----------
        spec : RobotSpec
        urdf, srdf : str
            Texts, xacro already expanded.
        package_dirs : sequence of str
        moveit_limits : mapping, optional
            A parsed ``joint_limits.yaml``.
        """
        description = read_urdf_joints(urdf)
        full = _model_from_text(description.text)
        chain = _Chain.between(full, spec.base_frame, spec.tcp.parent)
        moving = _moving_joints(full, spec, srdf, chain.joints)
        q_locked = _locked_positions(full, spec, description, moving)
        model, limits = _reduce(
            full, moving, q_locked, description, spec.limits, moveit_limits
        )
        tcp = _add_tcp(model, spec)
        root_base = model.frames[model.getFrameId(chain.base)].placement
        return cls(
            model=model,
            urdf=description.text,
            package_dirs=tuple(package_dirs),
            joint_names=tuple(moving),
            is_revolute=np.array([description.types[n] != "prismatic" for n in moving]),
            lower_rad=limits.lower,
            upper_rad=limits.upper,
            velocity_rad_s=limits.velocity,
            acceleration_rad_s2=limits.acceleration,
            base_frame=chain.base,
            T_root_base=np.array(root_base.homogeneous),
            T_world_base=spec.base_pose.matrix(),
            tcp_joint=int(tcp.parentJoint),
            T_joint_tcp=np.array(tcp.placement.homogeneous),
        )

    @property
    def dof(self) -> int:
        """Number of joints that move."""
        return len(self.joint_names)

    @property
    def T_base_root(self) -> FloatArray:
        """Root link (Pinocchio's universe) in robot_base, shape (4, 4)."""
        return inverse_transform(self.T_root_base)

    @property
    def T_root_world(self) -> FloatArray:
        """The cell's world in the root link, shape (4, 4)."""
        return self.T_root_base @ inverse_transform(self.T_world_base)

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
            Index in `model` of the joint that carries the frame, 0 for the root.
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
        frame = self.model.frames[_frame_id(self.model, name, "frame")]
        return int(frame.parentJoint), np.array(frame.placement.homogeneous)

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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Chain:
    """Base frame, and the joints from it to the TCP."""

    base: str
    joints: tuple[str, ...]

    @classmethod
    def between(cls, model: Any, base: str | None, tip: str) -> _Chain:
        tip_id = _frame_id(model, tip, "robot.tcp.parent")
        base = base or _root_link(model)
        base_id = _frame_id(model, base, "robot.base_frame")
        above_tip = [j for j in model.supports[model.frames[tip_id].parentJoint] if j]
        base_joint = model.frames[base_id].parentJoint
        above_base = [j for j in model.supports[base_joint] if j]
        if above_tip[: len(above_base)] != above_base:
            raise SceneError(
                f"robot.base_frame: {base!r} is not on the way from the root link "
                f"to {tip!r}"
            )
        joints = tuple(model.names[j] for j in above_tip[len(above_base) :])
        if not joints:
            raise SceneError(
                f"robot.tcp.parent: no joint moves {tip!r} relative to {base!r}"
            )
        return cls(base=base, joints=joints)


def _model_from_text(urdf: str) -> Any:
    try:
        return pin.buildModelFromXML(urdf)
    except Exception as error:
        raise SceneError(f"robot.urdf: Pinocchio refuses it ({error})") from error


def _root_link(model: Any) -> str:
    bodies = [f for f in model.frames if f.type == pin.FrameType.BODY]
    return str(bodies[0].name)


def _frame_id(model: Any, name: str, where: str) -> int:
    if not model.existFrame(name):
        names = [f.name for f in model.frames if f.name != "universe"]
        raise SceneError(
            f"{where}: the URDF has no frame {name!r} (frames: {', '.join(names)})"
        )
    wanted = pin.FrameType.BODY
    # Links and joints may share a name; a link is meant first.
    if model.existFrame(name, wanted):
        return int(model.getFrameId(name, wanted))
    return int(model.getFrameId(name))


def _moving_joints(
    model: Any, spec: RobotSpec, srdf: str, chain: Sequence[str]
) -> list[str]:
    """Joints that move, in chain order."""
    if spec.joints is not None:
        where, wanted = "robot.joints", spec.joints
    elif spec.group is not None:
        where, wanted = "robot.group", _group_members(model, spec.group, srdf)
    else:
        where, wanted = "robot.joints", chain
    locked = spec.locked_joints_deg
    problems = [
        f"{where}: joint {name!r} does not move the TCP (joints: {', '.join(chain)})"
        for name in wanted
        if name not in chain
    ]
    if spec.joints is not None:
        problems += [
            f"robot.locked_joints_deg: joint {name!r} is also in robot.joints"
            for name in spec.joints
            if name in locked
        ]
    names = list(model.names)[1:]
    problems += [
        f"robot.locked_joints_deg: no joint {name!r} (joints: {', '.join(names)})"
        for name in locked
        if name not in names
    ]
    moving = [name for name in chain if name in wanted and name not in locked]
    if not moving:
        problems.append(f"{where}: no joint is left that moves")
    if problems:
        raise SceneError(problems)
    return moving


def _group_members(model: Any, group: str, srdf: str) -> tuple[str, ...]:
    joints, ends = read_group(srdf, group)
    if ends is not None:
        joints += _Chain.between(model, ends[0], ends[1]).joints
    # Groups also list fixed joints, which no model has.
    return tuple(name for name in joints if model.existJointName(name))


def _locked_positions(
    model: Any, spec: RobotSpec, urdf: UrdfJoints, moving: Sequence[str]
) -> FloatArray:
    """Reference configuration of the full model [rad or m], shape (nq,)."""
    following = [name for name in moving if name in urdf.mimics]
    if following:
        raise SceneError(
            f"robot.urdf: joint(s) {', '.join(following)} follow another joint "
            "(mimic), which is not supported between base and TCP; lock them or "
            "give robot.joints"
        )
    # Zero, or the nearest position allowed: some joints (Panda's elbow) exclude it.
    q = np.clip(0.0, model.lowerPositionLimit, model.upperPositionLimit)
    for name, value in spec.locked_joints_deg.items():
        turns = urdf.types[name] != "prismatic"
        q[_index(model, name)] = math.radians(value) if turns else value
    for name, mimic in urdf.mimics.items():
        if name in spec.locked_joints_deg or not model.existJointName(mimic.joint):
            continue
        leader = q[_index(model, mimic.joint)]
        q[_index(model, name)] = mimic.multiplier * leader + mimic.offset
    return np.asarray(q, float)


def _index(model: Any, joint: str) -> int:
    return int(model.idx_qs[model.getJointId(joint)])


def _reduce(
    full: Any,
    moving: Sequence[str],
    q_locked: FloatArray,
    urdf: UrdfJoints,
    cell: JointLimits,
    moveit: Mapping[str, Any] | None,
) -> tuple[Any, LimitTable]:
    ranges = [
        JointRange(
            name=name,
            kind=urdf.types[name],
            lower=float(full.lowerPositionLimit[_index(full, name)]),
            upper=float(full.upperPositionLimit[_index(full, name)]),
            velocity=float(full.velocityLimit[_index(full, name)]),
        )
        for name in moving
    ]
    limits = merge_limits(ranges, cell, moveit)
    locked = [full.getJointId(n) for n in list(full.names)[1:] if n not in moving]
    model = pin.buildReducedModel(full, locked, q_locked)
    if list(model.names)[1:] != list(moving):
        raise SceneError("robot.urdf: the joints from base to TCP are not one chain")
    model.lowerPositionLimit = limits.lower
    model.upperPositionLimit = limits.upper
    return model, limits


def _add_tcp(model: Any, spec: RobotSpec) -> Any:
    parent_id = _frame_id(model, spec.tcp.parent, "robot.tcp.parent")
    parent = model.frames[parent_id]
    placement = parent.placement * pin.SE3(spec.tcp.matrix())
    frame = pin.Frame(
        TCP_FRAME, parent.parentJoint, parent_id, placement, pin.FrameType.OP_FRAME
    )
    return model.frames[model.addFrame(frame)]
