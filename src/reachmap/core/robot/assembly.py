"""From URDF text to a Pinocchio model of the joints between base and TCP."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import JointLimits, RobotSpec
from reachmap.core.robot.limits import JointRange, LimitTable, merge_limits
from reachmap.core.robot.urdf_joints import UrdfJoints
from reachmap.errors import SceneError

TCP_FRAME = "reachmap_tcp"
JOINT_SUFFIX = " (joint)"


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseToTip:
    """Base frame, and the joints from it to the TCP."""

    base: str
    joints: tuple[str, ...]

    @classmethod
    def between(cls, model: Any, base: str | None, tip: str) -> BaseToTip:
        """Find the chain; without a base frame it starts at the root link."""
        tip_id = find_frame(model, tip, "robot.tcp.parent")
        base = base or _root_link(model)
        base_id = find_frame(model, base, "robot.base_frame")
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


def model_from_text(urdf: str) -> Any:
    """Build the Pinocchio model of all joints of a URDF."""
    try:
        return pin.buildModelFromXML(urdf)
    except Exception as error:
        raise SceneError(f"robot.urdf: Pinocchio refuses it ({error})") from error


def _root_link(model: Any) -> str:
    bodies = [f for f in model.frames if f.type == pin.FrameType.BODY]
    return str(bodies[0].name)


def find_frame(model: Any, name: str, where: str) -> int:
    """Index of a URDF frame; `where` names the place in the cell for the message."""
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


def moving_joints(model: Any, spec: RobotSpec, chain: Sequence[str]) -> list[str]:
    """Joints that move, in chain order."""
    wanted = chain if spec.joints is None else spec.joints
    locked = spec.locked_joints_deg
    problems = [
        f"robot.joints: {name!r} does not move the TCP (joints: {', '.join(chain)})"
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
        problems.append("robot.joints: no joint is left that moves")
    if problems:
        raise SceneError(problems)
    return moving


def locked_positions(
    model: Any, spec: RobotSpec, urdf: UrdfJoints, moving: Sequence[str]
) -> FloatArray:
    """Give the positions of the full model, (nq,); moving joints at zero [rad or m]."""
    following = [
        name
        for name, mimic in urdf.mimics.items()
        if name in moving or mimic.joint in moving
    ]
    if following:
        raise SceneError(
            f"robot.urdf: {', '.join(following)}: a joint that mimics one of the "
            "joints between base and TCP is not supported; lock one of the two in "
            "robot.locked_joints_deg"
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


def reduced_model(
    full: Any,
    moving: Sequence[str],
    q_locked: FloatArray,
    urdf: UrdfJoints,
    cell: JointLimits,
) -> tuple[Any, LimitTable]:
    """Lock the joints that do not move, and merge the limits of the others."""
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
    limits = merge_limits(ranges, cell)
    locked = [full.getJointId(n) for n in list(full.names)[1:] if n not in moving]
    try:
        model = pin.buildReducedModel(_told_apart(full), locked, q_locked)
    except ValueError as error:
        raise SceneError(f"robot.urdf: joints cannot be locked ({error})") from error
    for joint, name in enumerate(model.names):
        model.names[joint] = name.removesuffix(JOINT_SUFFIX)
    for frame in model.frames:
        frame.name = frame.name.removesuffix(JOINT_SUFFIX)
    if list(model.names)[1:] != list(moving):
        raise SceneError("robot.urdf: the joints from base to TCP are not one chain")
    model.lowerPositionLimit = limits.lower
    model.upperPositionLimit = limits.upper
    return model, limits


def _told_apart(full: Any) -> Any:
    """Copy in which no joint shares its name with a link, which a URDF allows.

    Pinocchio looks up the frames of joints by name alone when it locks any.
    """
    model = full.copy()
    links = {f.name for f in full.frames if f.type == pin.FrameType.BODY}
    for frame in model.frames:
        if frame.name in links and frame.type != pin.FrameType.BODY:
            frame.name += JOINT_SUFFIX
    for joint, name in enumerate(full.names):
        if name in links:
            model.names[joint] = name + JOINT_SUFFIX
    return model


def add_tcp(model: Any, spec: RobotSpec) -> Any:
    """Add the TCP as a frame of the model."""
    parent_id = find_frame(model, spec.tcp.parent, "robot.tcp.parent")
    parent = model.frames[parent_id]
    placement = parent.placement * pin.SE3(spec.tcp.matrix())
    frame = pin.Frame(
        TCP_FRAME, parent.parentJoint, parent_id, placement, pin.FrameType.OP_FRAME
    )
    return model.frames[model.addFrame(frame)]
