"""The robot cell: one frozen, validated record for everything in the YAML file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from reachmap.cell.fields import (
    Angle,
    AngleRange,
    Coordinate,
    Finite,
    Identifier,
    Interval,
    Length,
    LengthRange,
    Name,
    NonNegative,
    PoseSpec,
    Positive,
    Rates,
    Record,
    Reference,
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

    packages: dict[str, Reference] = Field(
        default_factory=dict,
        max_length=100,
        description="Package name to folder, relative to the cell.",
    )


class TcpSpec(PoseSpec):
    """Tool centre point in its parent frame, and the axis it approaches along."""

    parent: Name = Field(description="URDF frame the TCP is fixed to.")
    approach_axis: SignedAxis = Field("+z", description="TCP axis into the object.")


class JointLimits(Record):
    """Limits that the URDF lacks or that the cell tightens.

    One number holds for all joints; a mapping names joints.
    """

    velocity_rad_s: Rates | None = Field(
        None, description="Highest velocity [rad/s; m/s for a prismatic joint]."
    )
    acceleration_rad_s2: Rates | None = Field(
        None, description="Highest acceleration [rad/s²; m/s² for a prismatic joint]."
    )
    position_deg: dict[str, Interval] = Field(
        default_factory=dict,
        description="Joint to [low, high] [deg; m for a prismatic joint].",
    )
    scaling: Annotated[float, Field(gt=0, le=1)] = Field(
        1.0, description="Speed-slider factor on velocities and accelerations."
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
        None, description="Joint of a 7-axis arm that is sampled on a grid."
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


FieldOfView = Annotated[float, Field(gt=0, lt=180, allow_inf_nan=False)]


class CameraSpec(PoseSpec):
    """The camera's optical frame: z into the scene, x to the right of the image."""

    parent: Name = Field(description="URDF frame the camera is fixed to.")
    range_m: LengthRange = Field((0.5, 0.6), description="Working distance [m].")
    field_of_view_deg: tuple[FieldOfView, FieldOfView] = Field(
        (57.0, 36.0), description="Full angles along image x and y [deg]."
    )

    @model_validator(mode="after")
    def _range_grows(self) -> CameraSpec:
        if not 0 < self.range_m[0] < self.range_m[1]:
            raise ValueError("range_m must be [near, far] with 0 < near < far")
        return self


class BodySpec(Record):
    """A rigid body that is not in the URDF."""

    name: Identifier = Field(description="Name in messages, maps and touch lists.")
    attach_to: Name = Field("world", description="world, robot_base or a URDF frame.")
    shape: Shape = Field(description="One primitive or mesh.")
    pose: PoseSpec = Field(PoseSpec(), description="Shape centre in the parent frame.")
    touch: tuple[Name, ...] = Field((), description="Links and bodies it may touch.")


class BinSpec(Record):
    """An open bin: five boxes around the inner volume."""

    inner: Size3 = Field(description="Inner x, y and depth [m].")
    wall: Length = Field(0.005, description="Thickness of the walls [m].")
    bottom: Length | None = Field(
        None, description="Thickness of the bottom [m]; default: that of the walls."
    )
    pose: PoseSpec = Field(
        PoseSpec(), description="Centre of the inner bottom in robot_base, z up."
    )
    touch: tuple[Name, ...] = Field((), description="Bodies the bin may touch.")


class ScanConfiguration(Record):
    """Joint values the picking cycle starts from; exactly one of the three."""

    q_deg: dict[str, Angle] | None = Field(
        None, description="Joint to position [deg; m for a prismatic joint]."
    )
    q_rad: dict[str, Angle] | None = Field(
        None, description="Joint to position [rad; m for a prismatic joint]."
    )
    group_state: Name | None = Field(None, description="A group_state of the SRDF.")

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

    planning_step_rad: Positive = Field(
        0.05, ge=1e-4, le=0.5, description="Joint-space step while searching [rad]."
    )
    verification_distance_m: Positive = Field(
        0.004,
        ge=1e-5,
        le=0.1,
        description="No point moves more than this between two checks [m].",
    )
    safety_margin_m: NonNegative = Field(
        0.002, le=0.1, description="Clearance that every pair of bodies keeps [m]."
    )


Count = Annotated[int, Field(ge=1, le=10000)]


class CubeSpec(Record):
    """A lattice of points: ``grid`` points along x and y, levels along z."""

    name: str = Field(
        pattern=r"^[A-Za-z_]\w*$", max_length=40, description="Name of its map."
    )
    min: Vector3 = Field(description="Lowest corner, robot_base [m].")
    max: Vector3 = Field(description="Highest corner, robot_base [m].")
    grid: tuple[Count, Count] = Field(description="Points along x and along y.")

    @model_validator(mode="after")
    def _corners_ordered(self) -> CubeSpec:
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if low > high:
                raise ValueError(f"min.{axis} = {low} is above max.{axis} = {high}")
        return self


MAX_FRAMES = 50_000_000


def _check_frame_count(count: int) -> None:
    if count > MAX_FRAMES:
        raise ValueError(
            f"at most {MAX_FRAMES:,} test frames in a scan (got {count:,})"
        )


class WorkspaceScanSpec(Record):
    """The workspace scan: cubes, levels, orientations, repeats."""

    cubes: tuple[CubeSpec, ...] = Field(
        min_length=1, max_length=16, description="Lattices that make up the map."
    )
    z_step: Length = Field(0.1, ge=1e-4, description="Distance between levels [m].")
    orientations: OrientationFamily = Field(
        ConeFamily(), description="Tool orientations tried at every point."
    )
    repeats: int = Field(
        5, ge=1, le=255, description="Planning attempts to a frame or a component."
    )

    def count(self) -> int:
        """Count the test frames of all cubes."""
        points = 0
        for cube in self.cubes:
            levels = int((cube.max[2] - cube.min[2]) / self.z_step + 1e-9) + 1
            points += cube.grid[0] * cube.grid[1] * levels
        return points * self.orientations.count()

    @model_validator(mode="after")
    def _bounded(self) -> WorkspaceScanSpec:
        names = [cube.name for cube in self.cubes]
        if len(set(names)) < len(names):
            raise ValueError(f"cubes need different names (got {', '.join(names)})")
        _check_frame_count(self.count())
        return self


Height = Annotated[Coordinate, Field(ge=0)]


class BinScanSpec(Record):
    """The bin scan: test grasps inside the bin, and the pick they stand for."""

    grid: tuple[Count, Count] = Field(
        (20, 14), description="Points along the bin's x and y."
    )
    layers: tuple[Height, ...] = Field(
        (0.05,),
        min_length=1,
        max_length=64,
        description="Heights above the bottom [m].",
    )
    orientations: OrientationFamily = Field(
        ConeFamily(), description="Tool orientations tried at every point."
    )
    repeats: int = Field(
        5, ge=1, le=255, description="Planning attempts to each test grasp."
    )
    approach_distance_m: Height = Field(
        0.0, description="Straight approach before the grasp [m]; 0 plans to the pose."
    )

    def count(self) -> int:
        """Count the test grasps."""
        points = self.grid[0] * self.grid[1] * len(self.layers)
        return points * self.orientations.count()

    @model_validator(mode="after")
    def _layers_rise(self) -> BinScanSpec:
        if list(self.layers) != sorted(set(self.layers)):
            raise ValueError(f"layers must rise strictly (got {list(self.layers)})")
        _check_frame_count(self.count() * self.repeats)
        return self


class PlacementSpec(Record):
    """Where the bin may stand."""

    x: LengthRange | None = Field(
        None, description="Range of the bin's centre along robot_base x [m]."
    )
    y: LengthRange | None = Field(
        None, description="Range of the bin's centre along robot_base y [m]."
    )
    z: LengthRange | None = Field(
        None, description="Range of the bin's inner bottom along robot_base z [m]."
    )
    yaw_deg: AngleRange = Field(
        (0.0, 180.0), description="Range of the bin's rotation about z [deg]."
    )


class Cell(Record):
    """A robot cell with everything needed to scan it."""

    format: Literal["reachmap.cell"] = Field(description="Marks a cell file.")
    format_version: str = Field(
        pattern=r"^1\.[0-9]{1,6}$",
        description='Version of the format, in quotes: "1.0".',
    )
    name: Identifier = Field(description="Name of the cell.")
    description: str = Field("", max_length=2000, description="One line for people.")
    resources: Resources = Field(Resources(), description="Where files are looked up.")
    robot: RobotSpec = Field(description="The arm.")
    camera: CameraSpec | None = Field(
        None, description="The 3D camera, if there is one."
    )
    bodies: tuple[BodySpec, ...] = Field(
        (), max_length=1000, description="Everything solid that is not in the URDF."
    )
    bin: BinSpec = Field(description="The bin that is picked from.")
    scan_configuration: ScanConfiguration = Field(
        description="Where the arm images the bin, and every path starts."
    )
    collision: CollisionSpec = Field(
        CollisionSpec(), description="Resolution of collision checking."
    )
    workspace_scan: WorkspaceScanSpec = Field(description="The workspace scan.")
    bin_scan: BinScanSpec = Field(BinScanSpec(), description="The bin scan.")
    planner: PlannerSpec = Field(PlannerSpec(), description="The planner.")
    placement: PlacementSpec = Field(
        PlacementSpec(), description="Limits that place-bin keeps to."
    )
    seed: int = Field(1, ge=0, lt=2**63, description="Seed of everything random.")

    @model_validator(mode="after")
    def _names_differ(self) -> Cell:
        names = [body.name for body in self.bodies]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ValueError(f"bodies need different names (repeated: {repeated})")
        return self
