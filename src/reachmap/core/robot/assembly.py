"""From URDF text to a Pinocchio model of the joints between base and TCP."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray
from reachmap.cell.files.urdf import FREE_JOINTS, MOVING
from reachmap.cell.model.cell import JointLimits, RobotSpec
from reachmap.core.robot.joints import (
    LINK_MARK,
    LimitTable,
    MimicJoint,
    UrdfJoints,
    merge_limits,
)
from reachmap.errors import SceneError

TCP_FRAME = "reachmap_tcp"
_DEG = math.degrees(1.0)
# Limits are copied into cells by hand, with few digits [deg or m].
_ROUNDED = 1e-3


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
    return str(bodies[0].name).removesuffix(LINK_MARK)


def find_frame(model: Any, name: str, where: str) -> int:
    """Index of a URDF frame; `where` names the place in the cell for the message."""
    # Links and joints may share a name; a link is meant first.
    if model.existFrame(name + LINK_MARK):
        name += LINK_MARK
    if not model.existFrame(name):
        names = [
            f.name.removesuffix(LINK_MARK) for f in model.frames if f.name != "universe"
        ]
        raise SceneError(
            f"{where}: the URDF has no frame {name!r} (frames: {', '.join(names)})"
        )
    return int(model.getFrameId(name))


def moving_joints(
    model: Any, spec: RobotSpec, urdf: UrdfJoints, chain: Sequence[str]
) -> list[str]:
    """Joints that move by themselves, in chain order."""
    chosen = chain if spec.joints is None else spec.joints
    locked = spec.locked_joints_deg
    wanted = [name for name in chain if name in chosen]
    moving = [
        name for name in wanted if name not in locked and name not in urdf.followers
    ]
    problems = [
        *_wrongly_chosen(spec, chain),
        *_of_several_degrees(spec, urdf),
        *_unknown_locked(model, locked),
        *_coupled(urdf, wanted, moving, chain, locked),
        *_locked_out_of_range(urdf, locked),
    ]
    if not moving:
        problems.append("robot.joints: no joint is left that moves")
    if problems:
        raise SceneError(problems)
    return moving


def _wrongly_chosen(spec: RobotSpec, chain: Sequence[str]) -> list[str]:
    chosen = spec.joints or ()
    return [
        f"robot.joints: {name!r} does not move the TCP (joints: {', '.join(chain)})"
        for name in chosen
        if name not in chain
    ] + [
        f"robot.locked_joints_deg: joint {name!r} is also in robot.joints"
        for name in chosen
        if name in spec.locked_joints_deg
    ]


def _of_several_degrees(spec: RobotSpec, urdf: UrdfJoints) -> list[str]:
    """Floating and planar joints between base and TCP."""
    way = urdf.description.way(
        spec.base_frame or urdf.description.root, spec.tcp.parent
    )
    return [
        f"robot.urdf: joint {joint.name!r} between base and TCP has type "
        f"{joint.type!r}; only fixed, {', '.join(MOVING)} joints are supported there "
        f"(robot.base_frame: {joint.child} leaves it out)"
        for joint in way
        if joint.type in FREE_JOINTS
    ]


def _unknown_locked(model: Any, locked: Mapping[str, float]) -> list[str]:
    names = list(model.names)[1:]
    return [
        f"robot.locked_joints_deg: no joint {name!r} (joints: {', '.join(names)})"
        for name in locked
        if name not in names
    ]


def _coupled(
    urdf: UrdfJoints,
    wanted: Sequence[str],
    moving: Sequence[str],
    chain: Sequence[str],
    locked: Mapping[str, float],
) -> list[str]:
    """Joints of the chain that another one drives, unless one of the two is locked."""
    return [
        f"robot.urdf: joint {name!r} is between base and TCP and follows "
        f"{leader.leader!r}; arms with coupled joints are not supported (one of the "
        "two can be locked in robot.locked_joints_deg)"
        for name, leader in urdf.followers.items()
        # A leader beside the chain is driven, too: the arm has an axis there.
        if name in wanted
        and (leader.leader in moving or leader.leader not in chain)
        and not {name, leader.leader} & set(locked)
    ]


def _locked_out_of_range(urdf: UrdfJoints, locked: Mapping[str, float]) -> list[str]:
    """Locked joints that cannot stand where they are to be held.

    Followers are left out: their limits are often given carelessly.
    """
    problems = []
    for name, value in locked.items():
        joint = urdf.joints.get(name)
        if joint is None or joint.mimics is not None or joint.type == "continuous":
            continue
        to_cell, unit = (1.0, "m") if joint.type == "prismatic" else (_DEG, "deg")
        low = -math.inf if joint.lower is None else to_cell * joint.lower
        high = math.inf if joint.upper is None else to_cell * joint.upper
        if not low - _ROUNDED <= value <= high + _ROUNDED:
            problems.append(
                f"robot.locked_joints_deg: joint {name!r} at {value:g} {unit} is "
                f"outside of its limits {low:.4g} … {high:.4g} {unit}"
            )
    return problems


def locked_positions(model: Any, spec: RobotSpec, urdf: UrdfJoints) -> FloatArray:
    """Give the positions of the full model, (nq,); moving joints at zero [rad or m].

    Followers of locked joints stand where their leaders put them, unless they are
    locked themselves.
    """
    # Zero, or the nearest position allowed: some joints (Panda's elbow) exclude it.
    q = np.clip(0.0, model.lowerPositionLimit, model.upperPositionLimit)
    for name, value in spec.locked_joints_deg.items():
        turns = urdf.joints[name].type != "prismatic"
        q[_index(model, name)] = math.radians(value) if turns else value
    for name, follower in urdf.followers.items():
        if name not in spec.locked_joints_deg:
            leader = q[_index(model, follower.leader)]
            q[_index(model, name)] = follower.multiplier * leader + follower.offset
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
    limits = merge_limits([urdf.joints[name] for name in moving], cell)
    model = _reduced(full, moving, q_locked)
    if list(model.names)[1:] != list(moving):
        raise SceneError("robot.urdf: the joints from base to TCP are not one chain")
    model.lowerPositionLimit = limits.lower
    model.upperPositionLimit = limits.upper
    return model, limits


def _reduced(full: Any, kept: Sequence[str], q_locked: FloatArray) -> Any:
    locked = [full.getJointId(n) for n in list(full.names)[1:] if n not in kept]
    try:
        return pin.buildReducedModel(full, locked, q_locked)
    except ValueError as error:
        raise SceneError(f"robot.urdf: joints cannot be locked ({error})") from error


def with_followers(
    full: Any,
    chain: Any,
    q_locked: FloatArray,
    followers: Mapping[str, MimicJoint],
) -> Any:
    """Model of the chain's joints, in order, and then of those that follow them.

    Parameters
    ----------
    full, chain : pinocchio.Model
    q_locked : array, shape (nq of full,)
    followers : mapping
        Joints that follow one of the chain.

    Returns
    -------
    pinocchio.Model
        The chain itself where nothing follows. Pinocchio has joints that mimic, but
        only such that come after their leaders in the tree.
    """
    if not followers:
        return chain
    moving = list(chain.names)[1:]
    tree = _reduced(full, [*moving, *followers], q_locked)
    order = [*moving, *(n for n in list(tree.names)[1:] if n in followers)]
    model, index = pin.Model(), {0: 0}
    for name in order:
        joint = tree.getJointId(name)
        index[joint] = model.addJoint(
            index[tree.parents[joint]],
            tree.joints[joint],
            tree.jointPlacements[joint],
            name,
        )
    for frame in list(tree.frames)[1:]:
        joint = index[frame.parentJoint]
        model.addFrame(pin.Frame(frame.name, joint, 0, frame.placement, frame.type))
    ends = np.array([chain.lowerPositionLimit, chain.upperPositionLimit])
    matrix, offset = following(moving, [(n, followers[n]) for n in order[chain.nq :]])
    both = ends @ matrix.T + offset
    model.lowerPositionLimit = np.append(ends[0], both.min(axis=0))
    model.upperPositionLimit = np.append(ends[1], both.max(axis=0))
    return model


def following(
    moving: Sequence[str], followers: Sequence[tuple[str, MimicJoint]]
) -> tuple[FloatArray, FloatArray]:
    """Matrix (followers, dof) and offset (followers,) from moving joints to others."""
    matrix = np.zeros((len(followers), len(moving)))
    for row, (_, follower) in zip(matrix, followers, strict=True):
        row[list(moving).index(follower.leader)] = follower.multiplier
    return matrix, np.array([follower.offset for _, follower in followers], float)


def add_tcp(model: Any, spec: RobotSpec) -> Any:
    """Add the TCP as a frame of the model."""
    parent_id = find_frame(model, spec.tcp.parent, "robot.tcp.parent")
    parent = model.frames[parent_id]
    placement = parent.placement * pin.SE3(spec.tcp.matrix())
    frame = pin.Frame(
        TCP_FRAME, parent.parentJoint, parent_id, placement, pin.FrameType.OP_FRAME
    )
    return model.frames[model.addFrame(frame)]
