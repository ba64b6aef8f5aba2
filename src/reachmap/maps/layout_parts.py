"""Variables that several formats share."""

from __future__ import annotations

from typing import Any, Final

from reachmap.maps.schema import Variable

PERCENT: Final[dict[str, Any]] = {"units": "percent", "low": 0.0, "high": 100.0}
NONNEGATIVE: Final[dict[str, Any]] = {"low": 0.0, "nan": True}


def index(path: str, meaning: str, **more: Any) -> Variable:
    """Describe a coordinate that only counts."""
    name = path.rpartition("/")[2]
    return Variable(
        path=path, dims=(name,), dtype="i4", units="1", meaning=meaning, low=0, **more
    )


def coordinate(path: str, meaning: str, frame: str) -> Variable:
    """Describe a coordinate in metres."""
    name = path.rpartition("/")[2]
    return Variable(
        path=path, dims=(name,), dtype="f8", units="m", meaning=meaning, frame=frame
    )


def outcome(prefix: str, dims: tuple[str, ...]) -> tuple[Variable, ...]:
    """Describe what both maps say of a test frame."""
    return (
        Variable(
            path=f"{prefix}status",
            dims=dims,
            dtype="u1",
            units="1",
            meaning="What became of the test frame.",
            is_status=True,
        ),
        Variable(
            path=f"{prefix}blocking_pair",
            dims=dims,
            dtype="i4",
            units="1",
            meaning="The two bodies in collision, an index into body_pairs; -1: none.",
            low=-1,
            labels="body_pairs",
            is_index=True,
        ),
        Variable(
            path=f"{prefix}n_ik",
            dims=dims,
            dtype="u1",
            units="1",
            meaning="Distinct solutions of the inverse kinematics.",
        ),
        Variable(
            path=f"{prefix}n_ik_free",
            dims=dims,
            dtype="u1",
            units="1",
            meaning="Solutions of the inverse kinematics that are free of collision.",
        ),
    )


def goal(prefix: str, dims: tuple[str, ...], which: str) -> Variable:
    """Describe the joint positions that a result rests on."""
    return Variable(
        path=f"{prefix}goal_configuration",
        dims=(*dims, "joint"),
        dtype="f8",
        units="rad",
        meaning=f"Joint positions at the test frame{which}; NaN where there are none.",
        nan=True,
    )


COMMON_SCALES = (
    index("joint", "Joints, in the order of joint_names.", labels="joint_names"),
    index("quat", "Parts of a quaternion: w, x, y, z."),
)
SCAN = Variable(
    path="scan_configuration",
    dims=("joint",),
    dtype="f8",
    units="rad",
    meaning="Joint positions from which every path starts.",
)
