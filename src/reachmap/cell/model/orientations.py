"""Families of tool orientations, as a cell describes them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Discriminator, Field, Tag, model_validator

from reachmap.cell.model.fields import Angle, Angles3, Record

# A choice: a ring every 3 degrees from straight down to level.
MAX_RINGS = 32
Tilt = Annotated[float, Field(ge=0, le=180, allow_inf_nan=False)]
Rolls = Annotated[int, Field(ge=1, le=360)]


Reference = Literal["world", "robot_base", "bin"]


def _ring_kind(value: Any) -> str:
    return "per ring" if isinstance(value, list | tuple) else "all rings"


# Callable discriminators, not plain unions: a mistake then gives one message.
RollsOfRings = Annotated[
    Annotated[Rolls, Tag("all rings")] | Annotated[tuple[Rolls, ...], Tag("per ring")],
    Discriminator(_ring_kind),
]
AnglesOfRings = Annotated[
    Annotated[Angle, Tag("all rings")] | Annotated[tuple[Angle, ...], Tag("per ring")],
    Discriminator(_ring_kind),
]


class Ring(NamedTuple):
    """Directions at one tilt, with their rolls."""

    tilt_deg: float
    azimuths: int
    rolls: int
    roll_offset_deg: float


class ConeFamily(Record):
    """Approach directions in cones about straight down, times rolls about them.

    Ring k has ``azimuths[k]`` directions at the tilt ``tilts_deg[k]``, the first at
    ``azimuth_offset_deg`` from the reference x axis; each is taken at ``rolls`` rolls
    spread evenly over ``roll_span_deg``, the first at ``roll_offset_deg``. Number and
    offset of the rolls may be given for all rings at once or ring by ring.
    """

    family: Literal["cone"] = Field("cone", description="Cones about straight down.")
    reference: Reference = Field(
        "world",
        description="Which vertical to use. world: azimuths are counted from the "
        "horizontal direction of robot_base's x (workspace scan) or the bin's.",
    )
    tilts_deg: tuple[Tilt, ...] = Field(
        (0.0, 30.0),
        min_length=1,
        max_length=MAX_RINGS,
        description="Angle of each ring from straight down [deg].",
    )
    azimuths: tuple[Annotated[int, Field(ge=1, le=360)], ...] = Field(
        (1, 8),
        min_length=1,
        max_length=MAX_RINGS,
        description="Number of directions in each ring.",
    )
    azimuth_offset_deg: Angle = Field(
        0.0, description="Azimuth of the first direction of each ring [deg]."
    )
    rolls: RollsOfRings = Field(
        3, description="Rolls about each approach direction, of all rings or of each."
    )
    roll_offset_deg: AnglesOfRings = Field(
        0.0, description="First roll [deg], of all rings or of each."
    )
    roll_span_deg: float = Field(
        360.0,
        gt=0,
        le=360,
        description="Range the rolls are spread over [deg]; 180 for a tool that is "
        "the same when turned by half a turn.",
    )

    @model_validator(mode="after")
    def _rings_agree(self) -> ConeFamily:
        rings = len(self.tilts_deg)
        for name in ("azimuths", "rolls", "roll_offset_deg"):
            value = getattr(self, name)
            if isinstance(value, tuple) and len(value) != rings:
                raise ValueError(
                    f"tilts_deg and {name} must have the same length "
                    f"(got {rings} and {len(value)})"
                )
        for tilt, count in zip(self.tilts_deg, self.azimuths, strict=True):
            if tilt in (0, 180) and count > 1:
                raise ValueError(
                    f"a ring with tilt {tilt:g} has one direction, straight "
                    f"{'up' if tilt else 'down'} (got {count} azimuths)"
                )
        return self

    def rings(self) -> Iterator[Ring]:
        """Go through the rings, each with its own rolls."""
        rolls, offset = self.rolls, self.roll_offset_deg
        for k, tilt_deg in enumerate(self.tilts_deg):
            yield Ring(
                tilt_deg=tilt_deg,
                azimuths=self.azimuths[k],
                rolls=rolls[k] if isinstance(rolls, tuple) else rolls,
                roll_offset_deg=offset[k] if isinstance(offset, tuple) else offset,
            )

    def count(self) -> int:
        """Count the orientations of the family."""
        return sum(ring.azimuths * ring.rolls for ring in self.rings())


class ListFamily(Record):
    """Orientations of the TCP, one by one, as roll, pitch, yaw in degrees."""

    family: Literal["list"] = Field(description="Orientations one by one.")
    reference: Reference | None = Field(
        None,
        description="Frame they are given in; null: robot_base in the workspace scan, "
        "bin in the bin scan.",
    )
    rpy_deg: tuple[Angles3, ...] = Field(
        min_length=1,
        max_length=1000,
        description="Roll, pitch, yaw [deg] of the TCP about fixed x, y, z.",
    )

    def count(self) -> int:
        """Count the orientations of the family."""
        return len(self.rpy_deg)


OrientationFamily = Annotated[ConeFamily | ListFamily, Field(discriminator="family")]
