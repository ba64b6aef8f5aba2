"""What stands around the arm and hangs on it: camera, bodies, bin."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from reachmap.cell.model.fields import (
    BaseOrWorld,
    Identifier,
    Length,
    LengthRange,
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


class BinSpec(Record):
    """An open bin: five boxes around the inner volume."""

    inner: Size3 = Field(description="Inner x, y and depth [m].")
    wall: Length = Field(0.005, description="Thickness of the walls [m].")
    bottom: Length | None = Field(
        None, description="Thickness of the bottom [m]; default: that of the walls."
    )
    frame: BaseOrWorld = Field("robot_base", description="Frame of pose.")
    pose: PoseSpec = Field(
        PoseSpec(), description="Centre of the inner bottom, z out of the bin."
    )
    touch: tuple[Name, ...] = Field((), description="Bodies the bin may touch.")
