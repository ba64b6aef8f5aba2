"""Arms for the tests of kinematics: real ones, and URDF texts of made-up ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import distribution
from pathlib import Path

import numpy as np
import pinocchio as pin

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.model.cell import RobotSpec
from reachmap.core.robot.model import RobotModel

SHARE = Path(str(distribution("example-robot-data").locate_file("cmeel.prefix/share")))
ROBOTS = SHARE / "example-robot-data" / "robots"

UR5 = "ur_description/urdf/ur5_robot.urdf"
PANDA = "panda_description/urdf/panda.urdf"
KINOVA = "kinova_description/robots/kinova.urdf"

UR5_JOINTS = tuple(
    f"{name}_joint"
    for name in (
        "shoulder_pan",
        "shoulder_lift",
        "elbow",
        "wrist_1",
        "wrist_2",
        "wrist_3",
    )
)


@cache
def urdf_text(name: str) -> str:
    """URDF of the data package."""
    return (ROBOTS / name).read_text(encoding="utf-8")


def robot(urdf: str, tcp: Mapping[str, object] | str, **spec: object) -> RobotModel:
    """Robot of a URDF text; accelerations are 5 rad/s² unless given."""
    spec.setdefault("limits", {"acceleration_rad_s2": 5.0})
    tcp = {"parent": tcp} if isinstance(tcp, str) else tcp
    description = RobotSpec.model_validate({"urdf": "arm.urdf", "tcp": tcp, **spec})
    return RobotModel.from_spec(description, urdf=urdf)


def ur5(*, half_turn: bool = False, **spec: object) -> RobotModel:
    """UR5 with its flange as TCP; limits ±2π (elbow ±π), or ±π for all joints."""
    if half_turn:
        spec["limits"] = {
            "acceleration_rad_s2": 5.0,
            "position_deg": {name: [-180, 180] for name in UR5_JOINTS},
        }
    return robot(urdf_text(UR5), spec.pop("tcp", "tool0"), **spec)  # type: ignore[arg-type]


@dataclass(frozen=True, kw_only=True)
class Link:
    """A joint of a made-up arm: where it is in the link before, and its axis."""

    xyz: Sequence[float] = (0.0, 0.0, 0.0)
    rpy: Sequence[float] = (0.0, 0.0, 0.0)
    axis: Sequence[float] = (0.0, 0.0, 1.0)
    kind: str = "revolute"
    limit: tuple[float, float] = (-3.141592653589793, 3.141592653589793)
    extra: str = ""


def serial_urdf(links: Sequence[Link]) -> str:
    """URDF of a chain ``link_0 → joint_1 → link_1 → …``."""
    parts = ['<robot name="arm"><link name="link_0"/>']
    for number, link in enumerate(links, start=1):
        xyz, rpy, axis = (
            " ".join(repr(float(v)) for v in values)
            for values in (link.xyz, link.rpy, link.axis)
        )
        limit = ""
        if link.kind not in ("continuous", "fixed", "floating"):
            low, high = link.limit
            limit = f'<limit lower="{low}" upper="{high}" velocity="2" effort="9"/>'
        parts.append(
            f'<link name="link_{number}"/>'
            f'<joint name="joint_{number}" type="{link.kind}">'
            f'<parent link="link_{number - 1}"/><child link="link_{number}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            f"{limit}{link.extra}</joint>"
        )
    return "".join([*parts, "</robot>"])


def pinocchio_tcp(arm: RobotModel, q: FloatArray) -> FloatArray:
    """T_base_tcp by Pinocchio, with nothing of this project but the model."""
    data = arm.model.createData()
    pin.framesForwardKinematics(arm.model, data, q)
    T_root_tcp = data.oMf[arm.model.getFrameId("reachmap_tcp")].homogeneous
    return np.asarray(np.linalg.inv(arm.T_root_base) @ T_root_tcp)


def misses(arm: RobotModel, Q: FloatArray, T: FloatArray) -> FloatArray:
    """Largest deviation of each configuration's pose matrix from its goal."""
    poses = np.array([pinocchio_tcp(arm, q) for q in Q]).reshape(-1, 4, 4)
    return np.abs(poses - T).reshape(len(Q), 16).max(axis=1, initial=0.0)


def turns_apart(difference: FloatArray) -> FloatArray:
    """Size of angle differences, whole turns not counted."""
    return np.abs((difference + np.pi) % (2 * np.pi) - np.pi)


def nearest_branch(Q: FloatArray, frame: IntArray, wanted: FloatArray) -> FloatArray:
    """Distance of the nearest solution to a wanted one, per frame, shape (n,)."""
    nearest = np.full(len(wanted), np.inf)
    apart = turns_apart(Q - wanted[frame]).max(axis=1)
    np.minimum.at(nearest, frame, apart)
    return nearest
