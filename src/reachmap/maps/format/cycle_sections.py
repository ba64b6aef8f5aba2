"""Variables of the pick cycle in bin maps of version 1.1."""

from __future__ import annotations

from typing import Any

from reachmap.maps.format.layout import (
    GRASP,
    NONNEGATIVE,
    PERCENT,
    POINT,
    Section,
    Variable,
    index,
    variable,
)
from reachmap.maps.parts import Cycle, StageStatus

_STAGE = (*GRASP, "stage")


def _stage(name: str, dtype: str, meaning: str, **more: Any) -> Variable:
    return variable(f"cycle/{name}", _STAGE, dtype, meaning, **more)


CYCLE = Section(
    field="cycle",
    part=Cycle,
    scales=(index("cycle/stage", "Stages after the grasp.", labels="stages"),),
    lists={"stages": "stages"},
    arrays={
        "status": _stage(
            "stage_status", "u1", "Outcome of the stage.", codes=StageStatus, units="1"
        ),
        "blocking_pair": _stage(
            "stage_blocking_pair",
            "i4",
            "The two bodies in collision, an index into body_pairs; -1: none.",
            low=-1,
            labels="body_pairs",
            is_index=True,
            units="1",
        ),
        "time": _stage(
            "stage_time", "f8", "Time optimum; NaN: no path.", units="s", **NONNEGATIVE
        ),
        "length": _stage(
            "stage_length",
            "f8",
            "Joint-space length; NaN: no path.",
            units="rad",
            **NONNEGATIVE,
        ),
        "drop_off": variable(
            "cycle/drop_off",
            GRASP,
            "i4",
            "Where the part goes, counted as in the cell; -1: nowhere.",
            low=-1,
            units="1",
        ),
        "cycle_time": variable(
            "cycle/cycle_time",
            GRASP,
            "f8",
            "Time of the whole cycle; NaN unless every stage has a path.",
            units="s",
            **NONNEGATIVE,
        ),
        "reachability": variable(
            "cycle/cycle_reachability",
            POINT,
            "f8",
            "Share of test grasps with a whole cycle, Eq. (1).",
            nan=True,
            **PERCENT,
        ),
    },
)

PART = Section(
    field="part_corners",
    scales=(index("cycle/corner", "Corners of the convex hull of the part."),),
    arrays={
        "part_corners": variable(
            "cycle/part_corner",
            ("corner", "xyz"),
            "f8",
            "Place of each corner in the frame of the TCP.",
            units="m",
            frame="tcp",
        )
    },
)

LIFT = Section(
    field="lift_above_rim",
    arrays={
        "lift_above_rim": variable(
            "cycle/lift_above_rim",
            GRASP,
            "f8",
            "Height of the part's lowest point above the rim after the lift; NaN "
            "unless every stage has a path.",
            units="m",
            nan=True,
        )
    },
)

STAGE_OF_PATH = Section(
    field="paths.stage",
    arrays={
        "stage": variable(
            "paths/stage",
            ("path",),
            "u1",
            "0: to the grasp; 1, 2, …: the stages of the cycle, in order.",
            units="1",
        )
    },
)

CYCLE_SECTIONS = (CYCLE, PART, LIFT, STAGE_OF_PATH)
