"""Bodies around the arm and attached to it: camera, bodies, bin."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Discriminator, Field, Tag, model_validator

from reachmap.cell.model.fields import (
    MAX_LENGTH_M,
    BaseOrWorld,
    Identifier,
    Length,
    LengthRange,
    MeshShape,
    Name,
    PoseSpec,
    Record,
    Shape,
    Size3,
)

FieldOfView = Annotated[float, Field(gt=0, lt=180, allow_inf_nan=False)]


class CameraSpec(PoseSpec):
    """The camera's optical frame: z into the scene, x to the right of the image."""

    parent: Name = Field(
        description="What it is fixed to: a URDF frame, world, robot_base or a body."
    )
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


def _wall_kind(value: Any) -> str:
    return "x and y walls" if isinstance(value, list | tuple) else "all walls"


# Callable discriminators, not plain unions: a mistake then gives one message.
Wall = Annotated[
    Annotated[Length, Tag("all walls")]
    | Annotated[tuple[Length, Length], Tag("x and y walls")],
    Discriminator(_wall_kind),
]
Depth = Annotated[float, Field(ge=0, le=MAX_LENGTH_M, allow_inf_nan=False)]


class RimSpec(Record):
    """A ledge around the walls' upper edge, on their outside."""

    width: Length = Field(description="How far it stands out from the walls [m].")
    height: Length = Field(description="How far it reaches down from the edge [m].")


def _inner_or_carrier(schema: dict[str, Any]) -> None:
    """Let editors take a carrier for the inner size, which the loader writes out."""
    schema["required"].remove("inner")
    if not schema["required"]:
        del schema["required"]
    schema["anyOf"] = [{"required": ["inner"]}, {"required": ["carrier"]}]


class BinSpec(Record):
    """An open bin: a bottom and four walls around the inner volume."""

    model_config = ConfigDict(json_schema_extra=_inner_or_carrier)

    name: Identifier | None = Field(
        None, description="Written by reachmap into resolved cells: its key in bins."
    )
    carrier: Name | None = Field(
        None,
        description="A load carrier by name, see `reachmap carriers`. It fills inner, "
        "inner_top, wall, bottom and rim where they are not given.",
    )
    inner: Size3 = Field(description="Inner x and y at the bottom, and depth [m].")
    inner_top: tuple[Length, Length] | None = Field(
        None,
        description="Inner x and y at the rim [m]; default: upright walls.",
    )
    wall: Wall = Field(
        0.005, description="Thickness of the walls, or of the x and the y walls [m]."
    )
    bottom: Length | None = Field(
        None,
        description="Thickness of the bottom [m]; default: that of the thinnest wall.",
    )
    rim: RimSpec | None = Field(None, description="Ledge around the upper edge.")
    mesh: MeshShape | None = Field(
        None,
        description="Shape of the bin in its own frame, in place of bottom, walls and "
        "rim; inner still says where grasps and parts are.",
    )
    heap: Depth = Field(
        0.0, description="Height of parts that fill the bin as an obstacle [m]."
    )
    frame: BaseOrWorld = Field("robot_base", description="Frame of pose.")
    on: Name | None = Field(
        None,
        description="Body whose top face the bin stands on; the height of pose is "
        "then set to it.",
    )
    pose: PoseSpec = Field(
        PoseSpec(), description="Centre of the inner bottom, z out of the bin."
    )
    touch: tuple[Name, ...] = Field((), description="Bodies the bin may touch.")

    @property
    def walls(self) -> tuple[float, float]:
        """Thickness of the walls across x and across y [m]."""
        return self.wall if isinstance(self.wall, tuple) else (self.wall, self.wall)

    @property
    def bottom_m(self) -> float:
        """Thickness of the bottom [m]."""
        return min(self.walls) if self.bottom is None else self.bottom

    @property
    def top(self) -> tuple[float, float]:
        """Inner x and y at the rim [m]."""
        return self.inner[:2] if self.inner_top is None else self.inner_top

    @property
    def outer(self) -> tuple[float, float, float]:
        """Largest outer x, y and height, rim included [m]."""
        ledge = 0.0 if self.rim is None else self.rim.width
        x, y = (
            max(low, high + 2 * ledge) + 2 * wall
            for low, high, wall in zip(self.inner, self.top, self.walls, strict=False)
        )
        return x, y, self.inner[2] + self.bottom_m

    @model_validator(mode="after")
    def _fits(self) -> BinSpec:
        depth = self.inner[2]
        if self.heap > depth:
            raise ValueError(
                f"heap must lie in the bin, which is {depth:g} m deep "
                f"(got {self.heap:g} m)"
            )
        if self.rim is not None and self.rim.height > depth + self.bottom_m:
            raise ValueError(
                f"rim.height must be at most the bin's height of "
                f"{depth + self.bottom_m:g} (got {self.rim.height:g})"
            )
        return self
