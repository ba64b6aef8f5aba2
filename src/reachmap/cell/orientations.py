"""Families of tool orientations, as a cell describes them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from reachmap.cell.fields import Angle, Angles3, Record

Tilt = Annotated[float, Field(ge=0, lt=180, allow_inf_nan=False)]


class ConeFamily(Record):
    """Approach directions in cones about straight down, times rolls about them.

    Ring k has ``azimuths[k]`` directions at the tilt ``tilts_deg[k]``, the first at
    ``azimuth_offset_deg`` from the reference x axis; each is taken at ``rolls`` rolls
    spread evenly over ``roll_span_deg``.
    """

    family: Literal["cone"] = Field("cone", description="Cones about straight down.")
    tilts_deg: tuple[Tilt, ...] = Field(
        (0.0, 30.0),
        min_length=1,
        max_length=32,
        description="Angle of each ring from straight down [deg].",
    )
    azimuths: tuple[Annotated[int, Field(ge=1, le=360)], ...] = Field(
        (1, 8),
        min_length=1,
        max_length=32,
        description="Number of directions in each ring.",
    )
    azimuth_offset_deg: Angle = Field(
        0.0, description="Azimuth of the first direction of each ring [deg]."
    )
    rolls: int = Field(
        3, ge=1, le=360, description="Rolls about each approach direction."
    )
    roll_offset_deg: Angle = Field(0.0, description="First roll [deg].")
    roll_span_deg: float = Field(
        360.0,
        gt=0,
        le=360,
        description="Range the rolls are spread over [deg]; 180 for a tool that is "
        "the same when turned by half a turn.",
    )

    @model_validator(mode="after")
    def _rings_agree(self) -> ConeFamily:
        if len(self.tilts_deg) != len(self.azimuths):
            raise ValueError(
                "tilts_deg and azimuths must have the same length "
                f"(got {len(self.tilts_deg)} and {len(self.azimuths)})"
            )
        for tilt, count in zip(self.tilts_deg, self.azimuths, strict=True):
            if tilt == 0 and count > 1:
                raise ValueError(
                    f"a ring with tilt 0 has one direction, straight down (got {count} "
                    "azimuths)"
                )
        return self

    def count(self) -> int:
        """Count the orientations of the family."""
        return sum(self.azimuths) * self.rolls


class ListFamily(Record):
    """Orientations of the TCP, one by one, as roll, pitch, yaw in degrees."""

    family: Literal["list"] = Field(description="Orientations one by one.")
    rpy_deg: tuple[Angles3, ...] = Field(
        min_length=1,
        max_length=1000,
        description="Roll, pitch, yaw [deg] of the TCP about fixed x, y, z.",
    )

    def count(self) -> int:
        """Count the orientations of the family."""
        return len(self.rpy_deg)


OrientationFamily = Annotated[ConeFamily | ListFamily, Field(discriminator="family")]
