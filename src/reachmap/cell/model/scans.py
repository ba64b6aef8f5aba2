"""The two scans as a cell describes them, and where the bin may go."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from reachmap.cell.model.fields import (
    AngleRange,
    BaseOrWorld,
    Coordinate,
    Length,
    LengthRange,
    Record,
    Vector3,
)
from reachmap.cell.model.orientations import ConeFamily, OrientationFamily

Count = Annotated[int, Field(ge=1, le=10000)]


class CubeSpec(Record):
    """A lattice of points: ``grid`` points along x and y, levels along z."""

    name: str = Field(
        pattern=r"^[A-Za-z_]\w*$", max_length=40, description="Name of its map."
    )
    min: Vector3 = Field(description="Lowest corner, frame of the scan [m].")
    max: Vector3 = Field(description="Highest corner, frame of the scan [m].")
    grid: tuple[Count, Count] = Field(description="Points along x and along y.")

    @model_validator(mode="after")
    def _corners_ordered(self) -> CubeSpec:
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if low > high:
                raise ValueError(f"min.{axis} = {low} is above max.{axis} = {high}")
        return self


# Ten million frames with five repeats, the example of docs/how-to/scale-out.md.
MAX_FRAMES = 50_000_000


def _check_frame_count(count: int) -> None:
    if count > MAX_FRAMES:
        raise ValueError(
            f"at most {MAX_FRAMES:,} test frames in a scan (got {count:,})"
        )


class WorkspaceScanSpec(Record):
    """The workspace scan: cubes, levels, orientations, repeats."""

    frame: BaseOrWorld = Field(
        "robot_base",
        description="Frame of the cubes; levels are its planes of equal z.",
    )
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
Share = Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)]
# Stroke of a bellows cup. Tilted by 30°, a tube of 10 mm radius dips 5 mm below its
# tip, and the safety margin is 2 mm as a rule.
PRESS_IN_M = 0.01


CLEAR_RIM: Literal["clear_rim"] = "clear_rim"


def word_or_length(value: object) -> str:
    """Tag of a word, such as clear_rim, or a length: one message, not two."""
    return "word" if isinstance(value, str) else "length"


Approach = Annotated[
    Annotated[Height, Tag("length")] | Annotated[Literal["clear_rim"], Tag("word")],
    Discriminator(word_or_length),
]


class BinScanSpec(Record):
    """The bin scan: test grasps inside the bin, and the pick they represent."""

    grid: tuple[Count, Count] = Field(
        (20, 14), description="Points along the bin's x and y."
    )
    layers: tuple[Height, ...] = Field(
        (0.05,),
        min_length=1,
        max_length=64,
        description="Heights above the bottom [m]; written out where fill gives them.",
    )
    fill: tuple[Share, ...] | None = Field(
        None,
        min_length=1,
        max_length=64,
        description="Levels of the parts in the bin, as shares of its depth, in place "
        "of layers. Grasps of a level lie on it, and what is below is an obstacle.",
    )
    fill_heights_m: tuple[Height, ...] | None = Field(
        None,
        min_length=1,
        max_length=64,
        description="The same as heights above the bottom [m].",
    )
    press_in_m: Height = Field(
        PRESS_IN_M,
        description="The obstacle ends this far below its level: a cup may press in, "
        "and a tilted tool dip below its tip, by this much [m].",
    )
    orientations: OrientationFamily = Field(
        ConeFamily(), description="Tool orientations tried at every point."
    )
    repeats: int = Field(
        5, ge=1, le=255, description="Planning attempts to each test grasp."
    )
    attempts: Literal["roadmap", "planner"] = Field(
        "roadmap",
        description="roadmap: paths branch off a shared network of routes; planner: "
        "the planner searches for each path from scratch, as in the paper.",
    )
    refine: int = Field(
        2000,
        ge=0,
        le=10_000,
        description="Number of grasps between the test grasps that get only a verdict, "
        "drawn where it is uncertain; at most the number of test grasps, and only "
        "where the roll is free. 0: none.",
    )
    approach_distance_m: Approach = Field(
        0.0,
        description="Straight approach before the grasp [m]; 0 plans to the pose; "
        "clear_rim: as long as the deepest and most tilted grasp needs for its "
        "approach to start above the rim.",
    )

    @property
    def is_filled(self) -> bool:
        """Whether each layer is the surface of parts that fill the bin below it."""
        return self.fill is not None or self.fill_heights_m is not None

    def heap_below_m(self, height_m: float) -> float:
        """Height of the obstacle below parts at a height [m]."""
        if not self.is_filled:
            return 0.0
        return max(round(height_m - self.press_in_m, 9), 0.0)

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


class ToleranceSpec(Record):
    """Expected error of the bin's position and heading."""

    shift_m: Annotated[float, Field(ge=0, le=1, allow_inf_nan=False)] = Field(
        0.03, description="In the plane [m]."
    )
    turn_deg: Annotated[float, Field(ge=0, le=90, allow_inf_nan=False)] = Field(
        5.0, description="About the vertical [deg]."
    )


class PlacementSpec(Record):
    """Where the bin may stand, in the frame of the workspace scan, stood upright."""

    x: LengthRange | None = Field(
        None, description="Range of the bin's centre along x [m]."
    )
    y: LengthRange | None = Field(
        None, description="Range of the bin's centre along y [m]."
    )
    z: LengthRange | None = Field(
        None, description="Range of the height of the bin's inner bottom [m]."
    )
    tolerance: ToleranceSpec = Field(
        ToleranceSpec(),
        description="Errors of the pose that its worst case is taken over; 0 and 0: "
        "none.",
    )
    yaw_deg: AngleRange = Field(
        (0.0, 180.0),
        description="Range of the bin's rotation about the vertical [deg].",
    )
