"""The robot cell: one frozen, validated record for everything in the YAML file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from reachmap.cell.fields import (
    Finite,
    Identifier,
    Interval,
    NonNegative,
    PoseSpec,
    Positive,
    Record,
    Shape,
    SignedAxis,
    Size3,
    Vector3,
)
from reachmap.cell.orientations import ConeFamily, OrientationFamily
from reachmap.cell.planner import PlannerSpec

FORMAT = "reachmap.cell"


class Resources(Record):
    """Where ``package://`` names are looked up, before the environment is."""

    packages: dict[str, str] = Field(
        default_factory=dict,
        description="Package name to folder (relative to the cell).",
    )


class TcpSpec(PoseSpec):
    """Tool centre point in its parent frame, and the axis it approaches along."""

    parent: str = Field(description="URDF frame the TCP is fixed to.")
    approach_axis: SignedAxis = Field("+z", description="TCP axis into the object.")


class JointLimits(Record):
    """Limits that the URDF lacks or that the cell tightens.

    One number holds for all joints; a mapping names joints.
    """

    velocity_rad_s: Positive | dict[str, Positive] | None = None
    acceleration_rad_s2: Positive | dict[str, Positive] | None = None
    position_deg: dict[str, Interval] = Field(default_factory=dict)
    scaling: Annotated[float, Field(gt=0, le=1)] = Field(
        1.0, description="Speed-slider factor on velocities and accelerations."
    )


class IkSpec(Record):
    """How inverse kinematics is solved."""

    method: Literal["auto", "analytic", "numeric"] = "auto"
    restarts: int = Field(
        32, ge=1, le=1000, description="Starts of the numeric solver."
    )
    redundant_joint: str | None = Field(
        None, description="Joint of a 7-axis arm that is sampled on a grid."
    )
    redundant_samples: int = Field(25, ge=1, le=1000)


class RobotSpec(Record):
    """The arm: URDF and what the URDF does not say."""

    urdf: str = Field(min_length=1, description=".urdf or .xacro; package:// or path.")
    xacro_args: dict[str, str] = Field(default_factory=dict)
    srdf: str | None = Field(None, description="Disabled collisions, group states.")
    group: str | None = Field(None, description="SRDF group that names the joints.")
    joints: tuple[str, ...] | None = Field(
        None, description="Joints that move; default: the chain from base to TCP."
    )
    locked_joints_deg: dict[str, Finite] = Field(
        default_factory=dict,
        description="Positions of joints that do not move [deg or m].",
    )
    base_frame: str | None = Field(
        None, description="URDF frame called robot_base; default: the root link."
    )
    base_pose: PoseSpec = Field(PoseSpec(), description="robot_base in world.")
    tcp: TcpSpec
    joint_limits: str | None = Field(None, description="MoveIt joint_limits.yaml.")
    limits: JointLimits = JointLimits()
    ik: IkSpec = IkSpec()


class CameraSpec(PoseSpec):
    """The camera's optical frame: z into the scene, x to the right of the image."""

    parent: str = Field(description="URDF frame the camera is fixed to.")
    range_m: Interval = Field((0.5, 0.6), description="Working distance [m].")
    field_of_view_deg: tuple[Positive, Positive] = Field(
        (57.0, 36.0), description="Full angles along image x and y."
    )

    @model_validator(mode="after")
    def _range_grows(self) -> CameraSpec:
        if not 0 < self.range_m[0] < self.range_m[1]:
            raise ValueError("range_m must be [near, far] with 0 < near < far")
        return self


class BodySpec(Record):
    """A rigid body that is not in the URDF."""

    name: Identifier
    attach_to: str = Field("world", description="world, robot_base or a URDF frame.")
    shape: Shape
    pose: PoseSpec = Field(PoseSpec(), description="Shape centre in the parent frame.")
    touch: tuple[str, ...] = Field((), description="Links and bodies it may touch.")


class BinSpec(Record):
    """An open bin: five boxes around the inner volume."""

    inner: Size3 = Field(description="Inner x, y and depth [m].")
    wall: Positive = Field(0.005, description="Thickness of the walls [m].")
    bottom: Positive | None = Field(None, description="Thickness of the bottom [m].")
    pose: PoseSpec = Field(
        PoseSpec(), description="Centre of the inner bottom in robot_base, z up."
    )
    touch: tuple[str, ...] = Field((), description="Bodies the bin may touch.")


class ScanConfiguration(Record):
    """Joint values the picking cycle starts from; exactly one of the three."""

    q_deg: dict[str, Finite] | None = None
    q_rad: dict[str, Finite] | None = None
    group_state: str | None = Field(None, description="A group_state of the SRDF.")

    @model_validator(mode="after")
    def _exactly_one(self) -> ScanConfiguration:
        given = [n for n in type(self).model_fields if getattr(self, n) is not None]
        if len(given) != 1:
            raise ValueError(
                "give exactly one of q_deg, q_rad, group_state "
                f"(got {', '.join(given) or 'none'})"
            )
        return self


class CollisionSpec(Record):
    """The two resolutions of a free motion, and the margin on every pair."""

    planning_step_rad: Positive = Field(0.05, le=0.5)
    verification_distance_m: Positive = Field(0.004, le=0.1)
    safety_margin_m: NonNegative = Field(0.002, le=0.1)


class CubeSpec(Record):
    """A lattice of points: ``grid`` points along x and y, levels along z."""

    name: Annotated[str, Field(pattern=r"^[A-Za-z_]\w*$", max_length=40)]
    min: Vector3 = Field(description="Lowest corner, robot_base [m].")
    max: Vector3 = Field(description="Highest corner, robot_base [m].")
    grid: tuple[
        Annotated[int, Field(ge=1, le=10000)], Annotated[int, Field(ge=1, le=10000)]
    ]

    @model_validator(mode="after")
    def _corners_ordered(self) -> CubeSpec:
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if low > high:
                raise ValueError(f"min.{axis} = {low} is above max.{axis} = {high}")
        return self


class WorkspaceScanSpec(Record):
    """The workspace scan: cubes, levels, orientations, repeats."""

    cubes: tuple[CubeSpec, ...] = Field(min_length=1, max_length=16)
    z_step: Positive = Field(0.1, description="Distance between levels [m].")
    orientations: OrientationFamily = ConeFamily()
    repeats: int = Field(5, ge=1, le=255)


class BinScanSpec(Record):
    """The bin scan: test grasps inside the bin, and the pick they stand for."""

    grid: tuple[
        Annotated[int, Field(ge=1, le=1000)], Annotated[int, Field(ge=1, le=1000)]
    ] = Field((20, 14), description="Points along the bin's x and y.")
    layers: tuple[NonNegative, ...] = Field(
        (0.05,),
        min_length=1,
        max_length=64,
        description="Heights above the bottom [m].",
    )
    orientations: OrientationFamily = ConeFamily()
    repeats: int = Field(5, ge=1, le=255)
    approach_distance_m: NonNegative = Field(
        0.0, description="Straight approach before the grasp; 0 plans to the pose."
    )

    @model_validator(mode="after")
    def _layers_rise(self) -> BinScanSpec:
        if list(self.layers) != sorted(set(self.layers)):
            raise ValueError("layers must rise strictly")
        return self


class PlacementSpec(Record):
    """Where the bin may stand."""

    x: Interval | None = Field(None, description="Range of the bin centre [m].")
    y: Interval | None = None
    z: Interval | None = None
    yaw_deg: Interval = (0.0, 180.0)


class Cell(Record):
    """A robot cell with everything needed to scan it."""

    format: Literal["reachmap.cell"]
    format_version: Annotated[str, Field(pattern=r"^1\.[0-9]+$")]
    name: Identifier
    description: str = ""
    resources: Resources = Resources()
    robot: RobotSpec
    camera: CameraSpec | None = None
    bodies: tuple[BodySpec, ...] = Field((), max_length=1000)
    bin: BinSpec
    scan_configuration: ScanConfiguration
    collision: CollisionSpec = CollisionSpec()
    workspace_scan: WorkspaceScanSpec
    bin_scan: BinScanSpec = BinScanSpec()
    planner: PlannerSpec = PlannerSpec()
    placement: PlacementSpec = PlacementSpec()
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 1

    @model_validator(mode="after")
    def _names_differ(self) -> Cell:
        names = [body.name for body in self.bodies]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ValueError(f"bodies need different names (repeated: {repeated})")
        return self
