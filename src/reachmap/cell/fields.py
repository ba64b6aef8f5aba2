"""Building blocks of the cell description: poses, shapes, limits, axes."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from reachmap._typing import FloatArray
from reachmap.geometry import (
    rotation_from_quaternion_wxyz,
    rotation_from_rpy_deg,
    transform_from_parts,
)

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Vector3 = tuple[Finite, Finite, Finite]
Size3 = tuple[Positive, Positive, Positive]
Interval = tuple[Finite, Finite]
SignedAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Identifier = Annotated[str, Field(min_length=1, max_length=80, pattern=r"^[\w.\- ]+$")]


class Record(BaseModel):
    """A frozen description; unknown keys are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


class PoseSpec(Record):
    """A pose: metres, and exactly one of ``rpy_deg`` and ``quaternion_wxyz``."""

    xyz: Vector3 = Field((0.0, 0.0, 0.0), description="Translation [m].")
    rpy_deg: Vector3 | None = Field(
        None, description="Roll, pitch, yaw [deg] about fixed x, y, z."
    )
    quaternion_wxyz: tuple[Finite, Finite, Finite, Finite] | None = Field(
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

    radius: Positive = Field(description="Radius [m].")
    length: Positive = Field(description="Full length along z [m].")


class CapsuleShape(CylinderShape):
    """A cylinder about z with two half-spheres; ``length`` without them."""


class SphereShape(Record):
    """A sphere, centred."""

    radius: Positive = Field(description="Radius [m].")


class MeshShape(Record):
    """A triangle mesh: STL, OBJ, DAE or PLY."""

    file: str = Field(
        min_length=1, description="package://, absolute or relative path."
    )
    scale: Positive | Size3 = Field(1.0, description="Factor to metres.")


class Shape(Record):
    """Exactly one of ``box``, ``cylinder``, ``capsule``, ``sphere``, ``mesh``."""

    box: Size3 | None = Field(None, description="Full sides x, y, z [m].")
    cylinder: CylinderShape | None = None
    capsule: CapsuleShape | None = None
    sphere: SphereShape | None = None
    mesh: MeshShape | None = None

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
