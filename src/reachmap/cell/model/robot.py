"""The arm as a cell describes it: URDF, tool centre point, limits."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from reachmap.cell.model.fields import (
    Finite,
    GrowingRecord,
    Interval,
    Name,
    PoseSpec,
    Rates,
    Record,
    Reference,
    SignedAxis,
)


class Resources(Record):
    """Where ``package://`` names are looked up, before the environment is."""

    packages: dict[str, Reference] = Field(
        default_factory=dict,
        max_length=100,
        description="Package name to folder, relative to the cell.",
    )


class TcpSpec(PoseSpec):
    """Tool centre point in its parent frame, and the axis it approaches along."""

    parent: Name = Field(description="URDF frame the TCP is fixed to.")
    approach_axis: SignedAxis = Field("+z", description="TCP axis into the object.")


class JointLimits(GrowingRecord):
    """Limits that the URDF lacks or that the cell tightens.

    One number holds for all joints; a mapping names joints.
    """

    later: ClassVar[tuple[str, ...]] = ("jerk_rad_s3",)

    velocity_rad_s: Rates | None = Field(
        None, description="Highest velocity [rad/s; m/s for a prismatic joint]."
    )
    acceleration_rad_s2: Rates | None = Field(
        None, description="Highest acceleration [rad/s²; m/s² for a prismatic joint]."
    )
    jerk_rad_s3: Rates | None = Field(
        None,
        description="Highest jerk [rad/s³; m/s³ for a prismatic joint]; needed where "
        "`planner.time_law` is jerk.",
    )
    position_deg: dict[str, Interval] = Field(
        default_factory=dict,
        description="Joint to [low, high] [deg; m for a prismatic joint].",
    )
    scaling: Annotated[float, Field(gt=0, le=1)] = Field(
        1.0,
        description="Motions take 1/scaling times as long: factor on velocities, its "
        "square on accelerations, its cube on jerks.",
    )


class IkSpec(Record):
    """How inverse kinematics is solved."""

    method: Literal["auto", "analytic", "numeric"] = Field(
        "auto", description="auto: analytic where the arm has a closed form."
    )
    restarts: int = Field(
        32, ge=1, le=1000, description="Starts of the numeric solver."
    )
    redundant_joint: Name | None = Field(
        None,
        description="Joint that is sampled if there are more than six; default: found.",
    )
    redundant_samples: int = Field(
        25, ge=1, le=1000, description="Values of the redundant joint that are tried."
    )


def _as_text(value: object) -> object:
    if isinstance(value, bool):
        return str(value).lower()
    return str(value) if isinstance(value, int | float) else value


XacroValue = Annotated[
    str,
    BeforeValidator(_as_text),
    WithJsonSchema({"type": ["string", "number", "boolean"]}),
]


class RobotSpec(Record):
    """The arm: URDF and what the URDF does not say."""

    urdf: Reference = Field(
        description="URDF or xacro file: package://, absolute, or relative to the cell."
    )
    xacro_args: dict[str, XacroValue] = Field(
        default_factory=dict,
        max_length=100,
        description="Arguments of a xacro file, name to value.",
    )
    srdf: Reference | None = Field(
        None, description="SRDF file: disabled collisions, groups, group states."
    )
    group: Name | None = Field(None, description="SRDF group that names the joints.")
    joints: tuple[Name, ...] | None = Field(
        None,
        min_length=1,
        max_length=64,
        description="Joints that move; default: the chain from the base to the TCP.",
    )
    locked_joints_deg: dict[str, Finite] = Field(
        default_factory=dict,
        description="Positions of joints that do not move [deg; m if prismatic].",
    )
    base_frame: Name | None = Field(
        None, description="URDF frame called robot_base; default: the root link."
    )
    base_pose: PoseSpec = Field(PoseSpec(), description="robot_base in world.")
    tcp: TcpSpec = Field(description="Tool centre point.")
    joint_limits: Reference | None = Field(
        None, description="MoveIt joint_limits.yaml, used where limits says nothing."
    )
    limits: JointLimits = Field(
        JointLimits(), description="Limits that the URDF lacks or that are tightened."
    )
    ik: IkSpec = Field(IkSpec(), description="Settings of inverse kinematics.")
