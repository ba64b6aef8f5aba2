"""The robot cell: one frozen, validated record for everything in the YAML file."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from reachmap._typing import FloatArray
from reachmap.cell.model.bodies import BinSpec, BodySpec, CameraSpec
from reachmap.cell.model.cycle import (
    CycleSpec,
    DropOffs,
    DropOffSpec,
    JointValues,
    LiftSpec,
    PartChoice,
    PartSpec,
)
from reachmap.cell.model.fields import (
    BaseOrWorld,
    Identifier,
    NonNegative,
    PoseSpec,
    Positive,
    Record,
)
from reachmap.cell.model.parameters import Parameters
from reachmap.cell.model.planner import PlannerSpec, RoadmapSpec
from reachmap.cell.model.robot import (
    IkSpec,
    JointLimits,
    Resources,
    RobotSpec,
    TcpSpec,
    ToolSpec,
)
from reachmap.cell.model.scans import (
    BinScanSpec,
    CubeSpec,
    PlacementSpec,
    WorkspaceScanSpec,
)
from reachmap.geometry import (
    inverse_transform,
    quaternion_wxyz_from_rotation,
    transform_from_parts,
    upright_rotation,
)

__all__ = [
    "BinScanSpec",
    "BinSpec",
    "BodySpec",
    "CameraSpec",
    "Cell",
    "CollisionSpec",
    "CubeSpec",
    "CycleSpec",
    "DropOffSpec",
    "IkSpec",
    "JointLimits",
    "JointValues",
    "LiftSpec",
    "PartSpec",
    "PlacementSpec",
    "Resources",
    "RoadmapSpec",
    "RobotSpec",
    "ScanConfiguration",
    "TcpSpec",
    "ToolSpec",
    "WorkspaceScanSpec",
]


class ScanConfiguration(JointValues):
    """Joint values the picking cycle starts from; exactly one of the three."""


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


class Cell(Record):
    """A robot cell with everything needed to scan it."""

    format: Literal["reachmap.cell"] = Field(description="Identifies a cell file.")
    format_version: str = Field(
        pattern=r"^1\.[0-9]{1,6}$",
        description='Version of the format, in quotes: "1.0".',
    )
    name: Identifier = Field(description="Name of the cell.")
    description: str = Field("", max_length=2000, description="One-line description.")
    parameters: Parameters = Field(
        {},
        max_length=100,
        description="Named numbers. Any number of the cell may be an expression of "
        'them, as in `"=pedestal_height - 0.402"`.',
    )
    expressions: dict[str, str] = Field(
        {},
        description="Written by reachmap into resolved cells: expressions by the key "
        "of the number they determine.",
    )
    resources: Resources = Field(Resources(), description="Where to find files.")
    robot: RobotSpec = Field(description="The arm.")
    tool: ToolSpec = Field(ToolSpec(), description="Rolls that the tool allows.")
    camera: CameraSpec | None = Field(
        None, description="The 3D camera, if there is one."
    )
    bodies: tuple[BodySpec, ...] = Field(
        (), max_length=1000, description="Everything solid that is not in the URDF."
    )
    bin: BinSpec = Field(description="The bin to pick from.")
    bins: dict[Identifier, BinSpec] = Field(
        {},
        max_length=20,
        description="Several bins by name, in place of bin. Each has its own placement "
        "and map, and is an obstacle for the others.",
    )
    pick_from: Identifier | None = Field(
        None,
        description="Which of the bins to scan (overridden by --bin); default: the "
        "first.",
    )
    scan_configuration: ScanConfiguration = Field(
        description="Where the camera images the bin and every path starts."
    )
    collision: CollisionSpec = Field(
        CollisionSpec(), description="Resolution of collision checking."
    )
    workspace_scan: WorkspaceScanSpec = Field(description="The workspace scan.")
    bin_scan: BinScanSpec = Field(BinScanSpec(), description="The bin scan.")
    planner: PlannerSpec = Field(PlannerSpec(), description="The planner.")
    roadmap: RoadmapSpec = Field(
        RoadmapSpec(), description="Search effort for connecting frames."
    )
    placement: PlacementSpec = Field(
        PlacementSpec(), description="Where place-bin may put the bin."
    )
    part: PartChoice | None = Field(
        None,
        description="The part to pick, or the name of one of parts; with it the bin "
        "scan continues after the grasp.",
    )
    parts: dict[Identifier, PartSpec] = Field(
        {},
        max_length=100,
        description="Several parts by name; the first is picked unless part names "
        "another.",
    )
    lift: LiftSpec = Field(LiftSpec(), description="How the part leaves the bin.")
    drop_off: DropOffs | None = Field(
        None, description="Where to put the part: one place, or a list of them."
    )
    cycle: CycleSpec = Field(CycleSpec(), description="Dwell times and return.")
    seed: int = Field(1, ge=0, lt=2**63, description="Seed of everything random.")

    @model_validator(mode="after")
    def _names_differ(self) -> Cell:
        names = [body.name for body in self.bodies]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ValueError(f"bodies need different names (repeated: {repeated})")
        return self

    @model_validator(mode="after")
    def _cycle_is_whole(self) -> Cell:
        if isinstance(self.part, str) and self.part not in self.parts:
            known = ", ".join(self.parts) or "none"
            raise ValueError(f"part: no part {self.part!r} (parts: {known})")
        names = [place.name for place in self.drop_offs]
        if len(set(names)) < len(names):
            raise ValueError(f"drop_off: names must differ (got {', '.join(names)})")
        return self

    @property
    def drop_offs(self) -> tuple[DropOffSpec, ...]:
        """Places that the part may go to; none where the cell has none."""
        given = self.drop_off
        if given is None:
            return ()
        return given if isinstance(given, tuple) else (given,)

    def held(self) -> tuple[str, PartSpec] | None:
        """Name and description of the part that is picked; None without one."""
        if isinstance(self.part, PartSpec):
            return "part", self.part
        name = self.part or next(iter(self.parts), None)
        return None if name is None else (f"part {name}", self.parts[name])

    def T_base_world(self) -> FloatArray:  # noqa: N802
        """The world in robot_base, shape (4, 4)."""
        return inverse_transform(self.robot.base_pose.matrix())

    def T_base_bin(self) -> FloatArray:  # noqa: N802
        """The bin in robot_base, shape (4, 4)."""
        return self.T_base_of(self.bin)

    def T_base_of(self, spec: BinSpec) -> FloatArray:  # noqa: N802
        """One of the bins in robot_base, shape (4, 4)."""
        return np.asarray(self._in_base(spec.frame) @ spec.pose.matrix())

    def every_bin(self) -> list[tuple[tuple[str, ...], BinSpec]]:
        """Place in the cell and description of the bin and of the others."""
        others = ((("bins", name), spec) for name, spec in self.bins.items())
        return [(("bin",), self.bin), *others]

    @property
    def bin_key(self) -> str:
        """Key of the bin to pick from in the cell file."""
        return "bin" if self.bin.name is None else f"bins.{self.bin.name}"

    def T_base_grid(self) -> FloatArray:  # noqa: N802
        """The frame of the workspace scan's lattice in robot_base, shape (4, 4)."""
        return self._in_base(self.workspace_scan.frame)

    def T_base_level(self) -> FloatArray:  # noqa: N802
        """The frame that heights and yaws are counted in, in robot_base, (4, 4).

        That of the workspace scan, stood upright about its origin where it leans.
        """
        T_base_grid = self.T_base_grid()
        R_world_grid = self.robot.base_pose.matrix()[:3, :3] @ T_base_grid[:3, :3]
        upright = transform_from_parts(upright_rotation(R_world_grid), np.zeros(3))
        return np.asarray(T_base_grid @ upright)

    def with_spec_at(
        self, spec: BinSpec, T_base_bin: FloatArray, frame: BaseOrWorld
    ) -> Cell:
        """Copy with another pose of one of the bins, written in a frame."""
        T = inverse_transform(self._in_base(frame)) @ T_base_bin
        pose = PoseSpec(
            xyz=tuple(T[:3, 3].tolist()),
            quaternion_wxyz=tuple(quaternion_wxyz_from_rotation(T[:3, :3]).tolist()),
        )
        placed = spec.model_copy(update={"pose": pose, "frame": frame})
        if spec is self.bin:
            return self.model_copy(update={"bin": placed})
        others = {n: placed if s is spec else s for n, s in self.bins.items()}
        return self.model_copy(update={"bins": others})

    def _in_base(self, frame: BaseOrWorld) -> FloatArray:
        return self.T_base_world() if frame == "world" else np.eye(4)


DIALECT = "https://json-schema.org/draft/2020-12/schema"


EXPRESSION = {"type": "string", "pattern": "^="}
NUMBER_OR_EXPRESSION = ({"type": "number"}, EXPRESSION)
ABOUT = ("title", "description", "default")


def _with_expressions(schema: Any) -> Any:
    """Let an expression of the parameters stand wherever a number may."""
    if isinstance(schema, list):
        return [_with_expressions(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    if schema.get("type") in ("number", "integer"):
        number = {key: value for key, value in schema.items() if key not in ABOUT}
        about = {key: value for key, value in schema.items() if key in ABOUT}
        return {"anyOf": [number, EXPRESSION], **about}
    return {key: _with_expressions(item) for key, item in schema.items()}


def cell_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a cell, generated from the model."""
    schema: dict[str, Any] = _with_expressions(Cell.model_json_schema())
    # A file has bin, or bins in its place, of which the loader makes one the bin.
    schema["required"].remove("bin")
    schema["anyOf"] = [{"required": ["bin"]}, {"required": ["bins"]}]
    named = schema["properties"]["parameters"]["patternProperties"]
    for pattern, entry in named.items():
        named[pattern] = {"anyOf": [entry, *NUMBER_OR_EXPRESSION]}
    head = {
        "$schema": DIALECT,
        "$id": "reachmap/cell-1.schema.json",
        "title": "reachmap cell 1.x",
    }
    return {**head, **{key: schema[key] for key in schema if key not in head}}
