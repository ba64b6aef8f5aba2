"""The pick cycle after the grasp: held part, lift, drop-offs, dwell times."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from reachmap.cell.model.fields import (
    Angle,
    Coordinate,
    Identifier,
    Length,
    Name,
    NonNegative,
    PoseSpec,
    Positive,
    Record,
    Shape,
)
from reachmap.cell.model.scans import CLEAR_RIM, word_or_length

Depth = Annotated[Coordinate, Field(ge=0)]


class PartSpec(Record):
    """The part held by the tool from the grasp until its release."""

    shape: Shape = Field(description="One primitive or mesh.")
    pose: PoseSpec = Field(PoseSpec(), description="Shape centre in the TCP frame.")
    yaw: Literal["fixed", "free"] = Field(
        "fixed",
        description="free: the part's rotation about the approach axis is unknown, so "
        "the volume swept by a full turn is carried.",
    )
    mass_kg: Positive | None = Field(None, description="Mass [kg]; informative.")
    touch: tuple[Name, ...] = Field((), description="Links and bodies it may touch.")


def _name_or_part(value: object) -> str:
    return "name" if isinstance(value, str) else "part"


# Callable discriminators, not plain unions: a mistake then gives one message.
PartChoice = Annotated[
    Annotated[Identifier, Tag("name")] | Annotated[PartSpec, Tag("part")],
    Discriminator(_name_or_part),
]


Height = Annotated[
    Annotated[Length, Tag("length")] | Annotated[Literal["clear_rim"], Tag("word")],
    Discriminator(word_or_length),
]


class LiftSpec(Record):
    """The straight way out of the bin with the part."""

    direction: Literal["vertical", "tool", "bin"] = Field(
        "vertical",
        description="vertical: up in the world; tool: back along the tool; bin: along "
        "the bin's z.",
    )
    height: Height = Field(
        CLEAR_RIM,
        description="Length of the lift [m]; clear_rim: until the whole part is 10 mm "
        "above the rim, or 7.5, 5 or 2.5 mm where it is blocked before.",
    )
    contact_allowance_m: Depth = Field(
        0.002,
        description="Depth to which the part may start in the bottom, and distance it "
        "may shift sideways between its neighbours [m].",
    )
    contact_distance_m: Depth = Field(
        0.005,
        description="Height of the lift at which the part must be clear of the bottom "
        "[m]; walls may never be touched.",
    )


class JointValues(Record):
    """Positions of all joints, in one of several ways."""

    q_deg: dict[str, Angle] | None = Field(
        None, description="Joint to position [deg; m for a prismatic joint]."
    )
    q_rad: dict[str, Angle] | None = Field(
        None, description="Joint to position [rad; m for a prismatic joint]."
    )
    group_state: Name | None = Field(None, description="A group_state of the SRDF.")

    @model_validator(mode="after")
    def _exactly_one(self) -> JointValues:
        ways = self.ways()
        given = [name for name in ways if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(
                f"give exactly one of {', '.join(ways)} "
                f"(got {', '.join(given) or 'none'})"
            )
        return self

    @classmethod
    def ways(cls) -> tuple[str, ...]:
        """Fields of which exactly one is given."""
        return ("q_deg", "q_rad", "group_state")


def _word_or_count(value: object) -> str:
    return "word" if isinstance(value, str) else "count"


Symmetry = Annotated[
    Annotated[Literal["z"], Tag("word")]
    | Annotated[int, Field(ge=1, le=360), Tag("count")],
    Discriminator(_word_or_count),
]


class DropOffSpec(JointValues):
    """A place that parts are put down at: a pose of the TCP, or joint values."""

    name: Identifier = Field("drop-off", description="Name in maps and messages.")
    frame: Name = Field(
        "world",
        description="Frame of pose: world, robot_base, bin, another bin by name, or a "
        "body that stands still.",
    )
    pose: PoseSpec | None = Field(
        None, description="TCP when the part is released, in that frame."
    )
    free_about: Symmetry = Field(
        1,
        description="z: any rotation about the z axis of pose is allowed; a number n: "
        "n-fold symmetry about it.",
    )
    approach_distance_m: Depth = Field(
        0.05, description="Straight approach of the part to its place [m]."
    )
    retreat_distance_m: Depth | None = Field(
        None,
        description="Straight retreat of the tool [m]; default: as the approach.",
    )

    @classmethod
    def ways(cls) -> tuple[str, ...]:
        """Fields of which exactly one is given."""
        return ("pose", *super().ways())

    @property
    def retreat_m(self) -> float:
        """Length of the straight retreat [m]."""
        given = self.retreat_distance_m
        return self.approach_distance_m if given is None else given

    def turns(self, most: int) -> int:
        """Rotations about z to try, evenly spaced; ``most`` where any is allowed."""
        return most if isinstance(self.free_about, str) else self.free_about


def _one_or_several(value: object) -> str:
    return "several" if isinstance(value, list | tuple) else "one"


DropOffs = Annotated[
    Annotated[DropOffSpec, Tag("one")]
    | Annotated[
        tuple[DropOffSpec, ...], Field(min_length=1, max_length=32), Tag("several")
    ],
    Discriminator(_one_or_several),
]


class CycleSpec(Record):
    """Dwell times of the cycle, and where it ends."""

    image_s: NonNegative = Field(
        0.0, description="From the arm's standstill until grasps are known [s]."
    )
    grasp_s: NonNegative = Field(0.0, description="To grip the part [s].")
    release_s: NonNegative = Field(0.0, description="To release it [s].")
    io_s: NonNegative = Field(0.0, description="Signals and other delays [s].")
    capture_overlaps_place: bool = Field(
        False,
        description="The camera is stationary and takes its image while the part is "
        "put down: only the time beyond place, retreat and return counts.",
    )
    return_to: JointValues | None = Field(
        None,
        description="Joint values that the arm returns to before it goes to the scan "
        "configuration; default: straight there.",
    )

    @property
    def waits_s(self) -> float:
        """All dwell times except that of the image [s]."""
        return self.grasp_s + self.release_s + self.io_s
