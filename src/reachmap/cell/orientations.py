"""Description of a family of tool orientations."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from reachmap.cell.fields import Finite, Record, Vector3

Tilt = Annotated[float, Field(ge=0, lt=180, allow_inf_nan=False)]


class ConeFamily(Record):
    """Approach directions in cones about straight down, times rolls about them.

    Ring k has ``azimuths[k]`` directions at the tilt ``tilts_deg[k]``, the first at
    ``azimuth_offset_deg`` from the reference x axis; each is taken at ``rolls`` rolls
    spread evenly over ``roll_span_deg``.
    """

    family: Literal["cone"] = "cone"
    tilts_deg: tuple[Tilt, ...] = Field((0.0, 30.0), min_length=1, max_length=32)
    azimuths: tuple[Annotated[int, Field(ge=1, le=360)], ...] = Field(
        (1, 8), min_length=1, max_length=32
    )
    azimuth_offset_deg: Finite = 0.0
    rolls: int = Field(3, ge=1, le=360)
    roll_offset_deg: Finite = 0.0
    roll_span_deg: float = Field(360.0, gt=0, le=360)

    @model_validator(mode="after")
    def _rings_agree(self) -> ConeFamily:
        if len(self.tilts_deg) != len(self.azimuths):
            raise ValueError(
                "tilts_deg and azimuths must have the same length "
                f"(got {len(self.tilts_deg)} and {len(self.azimuths)})"
            )
        return self


class ListFamily(Record):
    """Orientations of the TCP, one by one, as roll, pitch, yaw in degrees."""

    family: Literal["list"]
    rpy_deg: tuple[Vector3, ...] = Field(min_length=1, max_length=1000)


OrientationFamily = Annotated[ConeFamily | ListFamily, Field(discriminator="family")]
