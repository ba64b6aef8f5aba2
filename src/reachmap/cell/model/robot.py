"""The arm as a cell describes it: URDF, tool centre point, limits."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from reachmap.cell.model.fields import (
    Angle,
    Coordinate,
    Finite,
    GrowingRecord,
    Identifier,
    Interval,
    Length,
    Name,
    NonNegative,
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


class MountSpec(Record):
    """What carries the arm: base pose and body in one.

    The base stands on a pedestal, sits on a wall with its z axis level, or hangs from
    the ceiling; heights are those of robot_base above z = 0 of the world.
    """

    kind: Literal["pedestal", "wall", "ceiling"] = Field(
        "pedestal", description="What the base is fixed to."
    )
    height: Coordinate = Field(description="Of robot_base in the world [m].")
    at: tuple[Coordinate, Coordinate] = Field(
        (0.0, 0.0), description="x and y of robot_base in the world [m]."
    )
    yaw_deg: Angle = Field(
        0.0, description="Turn about the vertical; a wall faces this way [deg]."
    )
    tilt_deg: Angle = Field(
        0.0, description="Tilt in addition to that of the kind, towards the yaw [deg]."
    )
    size: tuple[Length, Length] | None = Field(
        None, description="Sides of the body across the base [m]; null: no body."
    )
    length: Length | None = Field(
        None,
        description="Of the body [m]; default: down to the floor for a pedestal, else "
        "0.1.",
    )
    gap: NonNegative = Field(
        0.002, le=0.5, description="Between robot_base and the body [m]."
    )
    name: Identifier = Field("mount", description="Of the body.")
    touch: tuple[Name, ...] = Field(
        (), description="Links and bodies that the body may touch."
    )

    @model_validator(mode="after")
    def _has_a_body(self) -> MountSpec:
        if self.size is not None and self.body_length <= 0.0:
            raise ValueError(
                f"a pedestal of height {self.height:g} has no length above the floor"
            )
        return self

    @property
    def body_length(self) -> float:
        """Length of the body behind the base [m]; by default to the floor, or 0.1."""
        if self.length is not None:
            return self.length
        return self.height - self.gap if self.kind == "pedestal" else 0.1

    @property
    def lean_deg(self) -> float:
        """Tilt of the base's z axis from the vertical, towards the yaw [deg]."""
        return {"pedestal": 0.0, "wall": 90.0, "ceiling": 180.0}[self.kind] + (
            self.tilt_deg
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


class RobotSpec(GrowingRecord):
    """The arm: URDF and what the URDF does not say."""

    later: ClassVar[tuple[str, ...]] = ("mount",)

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
    mount: MountSpec | None = Field(
        None,
        description="What carries the arm, in place of base_pose and of a body.",
    )
    tcp: TcpSpec = Field(description="Tool centre point.")
    joint_limits: Reference | None = Field(
        None, description="MoveIt joint_limits.yaml, used where limits says nothing."
    )
    limits: JointLimits = Field(
        JointLimits(), description="Limits that the URDF lacks or that are tightened."
    )
    ik: IkSpec = Field(IkSpec(), description="Settings of inverse kinematics.")


LISTED, FREE = "listed", "free"
ROLLS = r"^(listed|free|([2-9]|[1-9][0-9])-fold)$"


class ToolSpec(Record):
    """How the tool may be turned about its approach axis."""

    roll: Annotated[str, Field(pattern=ROLLS)] = Field(
        LISTED,
        description="listed: the rolls of the orientations; free: any roll, as for "
        "a suction cup; N-fold, such as 2-fold: the tool is symmetric under 1/N of "
        "a turn.",
    )
    rolls: int = Field(
        24, ge=2, le=360, description="Rolls tried per direction where roll is free."
    )

    def count(self) -> int:
        """Equivalent rolls per direction, evenly spaced over a turn."""
        if self.roll == LISTED:
            return 1
        return self.rolls if self.roll == FREE else int(self.roll.split("-")[0])
