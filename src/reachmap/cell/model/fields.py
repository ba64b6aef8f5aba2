"""Building blocks of the cell description: poses, shapes, limits, axes."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    SerializerFunctionWrapHandler,
    Tag,
    model_serializer,
    model_validator,
)

from reachmap._typing import FloatArray
from reachmap.geometry import (
    rotation_from_quaternion_wxyz,
    rotation_from_rpy_deg,
    transform_from_parts,
)

# Larger than any cell, and ten turns: numbers beyond are in other units.
MAX_LENGTH_M = 100.0
MAX_ANGLE_DEG = 3600.0

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Coordinate = Annotated[
    float, Field(ge=-MAX_LENGTH_M, le=MAX_LENGTH_M, allow_inf_nan=False)
]
Length = Annotated[float, Field(gt=0, le=MAX_LENGTH_M, allow_inf_nan=False)]
Angle = Annotated[
    float, Field(ge=-MAX_ANGLE_DEG, le=MAX_ANGLE_DEG, allow_inf_nan=False)
]
Unit = Annotated[float, Field(ge=-1.01, le=1.01, allow_inf_nan=False)]
Vector3 = tuple[Coordinate, Coordinate, Coordinate]
Angles3 = tuple[Angle, Angle, Angle]
Size3 = tuple[Length, Length, Length]
SignedAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
BaseOrWorld = Literal["robot_base", "world"]
NAMES = r"^[\w.+\- ]+$"
Identifier = Annotated[str, Field(min_length=1, max_length=80, pattern=NAMES)]
Name = Annotated[str, Field(min_length=1, max_length=200)]
Reference = Annotated[str, Field(min_length=1, max_length=4000)]


def _rising(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] >= interval[1]:
        raise ValueError(f"expected [low, high] with low < high (got {list(interval)})")
    return interval


def _not_falling(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] > interval[1]:
        raise ValueError(
            f"expected [low, high] with low <= high (got {list(interval)})"
        )
    return interval


Interval = Annotated[tuple[Finite, Finite], AfterValidator(_rising)]
LengthRange = Annotated[tuple[Coordinate, Coordinate], AfterValidator(_not_falling)]
AngleRange = Annotated[tuple[Angle, Angle], AfterValidator(_not_falling)]


def _rate_kind(value: Any) -> str:
    return "per joint" if isinstance(value, dict) else "all joints"


# Callable discriminators, not plain unions: a mistake then gives one message.
Rates = Annotated[
    Annotated[Positive, Tag("all joints")]
    | Annotated[dict[str, Positive], Tag("per joint")],
    Discriminator(_rate_kind),
]


class Record(BaseModel):
    """A frozen description; unknown keys are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class GrowingRecord(Record):
    """A record some of whose keys came later than the first maps.

    At its default such a key is left out of what is stored and hashed, so that cells
    that do not use it keep their hashes.
    """

    later: ClassVar[tuple[str, ...]] = ()

    @model_serializer(mode="wrap")
    def _without_unused(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = handler(self)
        for name in self.later:
            if getattr(self, name) == type(self).model_fields[name].default:
                data.pop(name, None)
        return data


class PoseSpec(Record):
    """A pose: metres, and exactly one of ``rpy_deg`` and ``quaternion_wxyz``."""

    xyz: Vector3 = Field((0.0, 0.0, 0.0), description="Translation [m].")
    rpy_deg: Angles3 | None = Field(
        None, description="Roll, pitch, yaw [deg] about fixed x, y, z."
    )
    quaternion_wxyz: tuple[Unit, Unit, Unit, Unit] | None = Field(
        None, description="Unit quaternion, scalar first."
    )

    @model_validator(mode="after")
    def _one_orientation(self) -> PoseSpec:
        if self.rpy_deg is not None and self.quaternion_wxyz is not None:
            raise ValueError("give rpy_deg or quaternion_wxyz, not both")
        if self.quaternion_wxyz is not None:
            norm = float(np.linalg.norm(self.quaternion_wxyz))
            if abs(norm - 1.0) > 1e-2:
                raise ValueError(f"quaternion_wxyz must have length 1 (got {norm:.4g})")
        return self

    def matrix(self) -> FloatArray:
        """Homogeneous matrix, shape (4, 4)."""
        if self.quaternion_wxyz is not None:
            R = rotation_from_quaternion_wxyz(np.array(self.quaternion_wxyz))
        else:
            R = rotation_from_rpy_deg(np.array(self.rpy_deg or (0.0, 0.0, 0.0)))
        return transform_from_parts(R, np.array(self.xyz))


class CylinderShape(Record):
    """A cylinder about z, centred."""

    radius: Length = Field(description="Radius [m].")
    length: Length = Field(description="Full length along z [m].")


class CapsuleShape(CylinderShape):
    """A cylinder about z with two half-spheres; ``length`` without them."""


class SphereShape(Record):
    """A sphere, centred."""

    radius: Length = Field(description="Radius [m].")


def _scale_kind(value: Any) -> str:
    return "per axis" if isinstance(value, list | tuple) else "uniform"


Scale = Annotated[
    Annotated[Positive, Tag("uniform")]
    | Annotated[tuple[Positive, Positive, Positive], Tag("per axis")],
    Discriminator(_scale_kind),
]


class MeshShape(Record):
    """A triangle mesh: STL, OBJ, DAE or PLY."""

    file: Reference = Field(
        description="Mesh file: package://, absolute, or relative to the cell."
    )
    scale: Scale = Field(1.0, description="Factor to metres, one or per axis.")

    @property
    def factors(self) -> tuple[float, float, float]:
        """Factor to metres along each axis."""
        scale = self.scale
        return scale if isinstance(scale, tuple) else (scale, scale, scale)


class Shape(Record):
    """Exactly one of ``box``, ``cylinder``, ``capsule``, ``sphere``, ``mesh``."""

    box: Size3 | None = Field(None, description="Full sides x, y, z [m].")
    cylinder: CylinderShape | None = Field(None, description="Cylinder about z.")
    capsule: CapsuleShape | None = Field(None, description="Capsule about z.")
    sphere: SphereShape | None = Field(None, description="Sphere.")
    mesh: MeshShape | None = Field(None, description="Triangle mesh from a file.")

    @model_validator(mode="after")
    def _exactly_one(self) -> Shape:
        given = [name for name in type(self).model_fields if getattr(self, name)]
        if len(given) != 1:
            wanted = ", ".join(type(self).model_fields)
            raise ValueError(f"give exactly one of {wanted} (got {given or 'none'})")
        return self

    def kind(self) -> tuple[str, Any]:
        """Name of the shape that is set, and its value."""
        return next(
            (name, value)
            for name in type(self).model_fields
            if (value := getattr(self, name)) is not None
        )
