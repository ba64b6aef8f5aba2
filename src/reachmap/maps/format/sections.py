"""Optional sections of files of version 1.1: evidence, effort, margins."""

from __future__ import annotations

from typing import Any, Final

from reachmap.maps.format.cycle_sections import CYCLE_SECTIONS
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
from reachmap.maps.parts import (
    ApproachTimes,
    BestPaths,
    Components,
    Effort,
    Margins,
    Refinement,
)
from reachmap.maps.records import Status

_TRY = (*GRASP, "repeat")
_ONE: Final[dict[str, Any]] = {"units": "1"}
_POSE_SCALES = (
    index("pose_row", "Rows of a homogeneous matrix."),
    index("pose_column", "Columns of a homogeneous matrix."),
)


def _component(name: str, dtype: str, meaning: str, **more: Any) -> Variable:
    return variable(
        f"components/{name}", ("component",), dtype, meaning, **_ONE, **more
    )


def _pose(name: str, meaning: str, frame: str, *, with_scales: bool = False) -> Section:
    """One pose; with scales where the rest of the file has no pose."""
    return Section(
        field=name,
        scales=_POSE_SCALES if with_scales else (),
        arrays={
            name: variable(
                name,
                ("pose_row", "pose_column"),
                "f8",
                f"{meaning}; the rotation block has no unit.",
                units="m",
                frame=frame,
            )
        },
    )


def world(*, with_scales: bool = False) -> Section:
    """Where the robot stands."""
    meaning = "Pose of robot_base in the world"
    return _pose("T_world_base", meaning, "world", with_scales=with_scales)


COMPONENTS = Section(
    field="components",
    part=Components,
    scales=(
        index("components/component", "Connected components of the roadmap."),
        index("components/method", "Methods of search.", labels="methods"),
    ),
    lists={"methods": "methods"},
    arrays={
        "attempts": _component("attempts", "i4", "Searches for the component.", low=0),
        "checks": _component("checks", "i4", "State checks that they took.", low=0),
        "reached": _component(
            "reached", "u1", "1 where a search arrived.", is_flag=True
        ),
        "agreed": _component(
            "agreed",
            "u1",
            "1 where an independent method came to the same verdict.",
            is_flag=True,
        ),
        "method_checks": variable(
            "components/method_checks",
            ("component", "method"),
            "i4",
            "State checks by each method; they add up to checks.",
            low=0,
            **_ONE,
        ),
    },
)

CONFIDENCE = Section(
    field="components.confidence",
    arrays={
        "confidence": _component(
            "confidence",
            "f8",
            "Share of the reachable components of the calibration that were reached "
            "with no more checks; 1 where this one is.",
            low=0,
            high=1,
        )
    },
)

COMPONENT = Section(
    field="component",
    arrays={
        "component": variable(
            "component",
            GRASP,
            "i4",
            "Connected component of the roadmap; -1: none.",
            low=-1,
            **_ONE,
        )
    },
)

ROLLS = Section(
    field="",
    arrays={
        "direction_reachability": variable(
            "direction_reachability",
            POINT,
            "f8",
            "Share of approach directions with a path for at least one roll.",
            nan=True,
            **PERCENT,
        ),
        "point_reachability": variable(
            "point_reachability",
            POINT,
            "f8",
            "100 where at least one direction has a path, 0 where none has.",
            nan=True,
            **PERCENT,
        ),
    },
)

WINNING_ROLL = Section(
    field="winning_roll",
    arrays={
        "winning_roll": variable(
            "winning_roll",
            GRASP,
            "f8",
            "Roll about the approach axis that the best path takes; NaN without one.",
            units="rad",
            nan=True,
        )
    },
)

EFFORT = Section(
    field="effort",
    part=Effort,
    numbers={"seconds_per_check": "seconds_per_check"},
    arrays={
        "checks": variable(
            "effort_checks",
            _TRY,
            "u4",
            "State checks of the search; 0 where nothing was sought.",
            number="seconds_per_check",
            **_ONE,
        )
    },
)


def _of_best(name: str, units: str, meaning: str) -> Variable:
    return variable(name, GRASP, "f8", meaning, units=units, **NONNEGATIVE)


BEST = Section(
    field="best",
    part=BestPaths,
    arrays={
        "row": variable(
            "best_path",
            GRASP,
            "i4",
            "Row of /paths that a line would run; -1: none.",
            low=-1,
            **_ONE,
        ),
        "path_length": _of_best(
            "best_path_length", "rad", "Joint-space length of best_path; NaN: none."
        ),
        "execution_time": _of_best(
            "best_execution_time", "s", "execution_time of best_path; NaN: none."
        ),
        "effort_checks": variable(
            "best_effort_checks",
            GRASP,
            "u4",
            "State checks that best_path took; 0: none.",
            **_ONE,
        ),
    },
)

TIMES = Section(
    field="times",
    part=ApproachTimes,
    arrays={
        "approach": variable(
            "approach_time",
            _TRY,
            "f8",
            "Time optimum of the straight approach, a part of execution_time; "
            "NaN where no path was found.",
            units="s",
            **NONNEGATIVE,
        ),
        "retreat": variable(
            "retreat_time",
            _TRY,
            "f8",
            "Time optimum of the straight way back, no part of execution_time; "
            "NaN where no path was found.",
            units="s",
            **NONNEGATIVE,
        ),
    },
)

MARGINS = Section(
    field="margins",
    part=Margins,
    arrays={
        "clearance": _of_best(
            "clearance", "m", "Least distance of two bodies on best_path; NaN: none."
        ),
        "clearance_pair": variable(
            "clearance_pair",
            GRASP,
            "i4",
            "The two bodies that come closest, an index into body_pairs; -1: none.",
            low=-1,
            labels="body_pairs",
            is_index=True,
            **_ONE,
        ),
        "joint_margin": _of_best(
            "joint_margin",
            "rad",
            "Least distance to a joint limit at the goal and on the approach; "
            "NaN: none.",
        ),
        "smallest_singular_value": _of_best(
            "smallest_singular_value",
            "1",
            "Least singular value of the TCP Jacobian (m, rad) at the goal and on the "
            "approach; NaN: none.",
        ),
    },
)


REFINEMENT = Section(
    field="refinement",
    part=Refinement,
    scales=(index("refinement/sample", "Grasps between the test grasps."),),
    numbers={"lever_m": "lever_m"},
    arrays={
        "position": variable(
            "refinement/position",
            ("sample", "xyz"),
            "f8",
            "TCP position of grasps between the test grasps.",
            units="m",
            frame="robot_base",
            number="lever_m",
        ),
        "quaternion_wxyz": variable(
            "refinement/quaternion_wxyz",
            ("sample", "quat"),
            "f8",
            "TCP orientation in the roll that is reached, in any where none is; unit "
            "quaternion.",
            frame="robot_base",
            **_ONE,
        ),
        "status": variable(
            "refinement/status",
            ("sample",),
            "u1",
            "Outcome in any roll.",
            codes=Status,
            **_ONE,
        ),
    },
)

BIN_SECTIONS = (
    COMPONENT, COMPONENTS, CONFIDENCE, ROLLS, WINNING_ROLL, EFFORT, BEST, TIMES,
    MARGINS, *CYCLE_SECTIONS, REFINEMENT, world(),
)  # fmt: skip
WORKSPACE_SECTIONS = (
    COMPONENTS,
    CONFIDENCE,
    world(with_scales=True),
    _pose("T_base_grid", "Frame of x, y, z in robot_base", "robot_base"),
)

PLACEMENT_SECTIONS = (
    Section(
        field="tolerance",
        scales=(
            index(
                "tolerance_part",
                "What the tolerance allows: shift [m], turn [rad].",
                labels="tolerance_parts",
            ),
        ),
        arrays={
            "tolerance": variable(
                "tolerance",
                ("tolerance_part",),
                "f8",
                "Shift [m] and turn [rad] under which worst_score is taken.",
                low=0.0,
                **_ONE,
            )
        },
    ),
    *(
        Section(
            field=name,
            arrays={
                name: variable(name, ("candidate",), "f8", meaning, nan=True, **PERCENT)
            },
        )
        for name, meaning in (
            ("worst_score", "Least score under the tolerance; NaN: excluded."),
            ("score_error", "Standard error of the score; NaN: excluded."),
        )
    ),
    world(),
    _pose(
        "T_base_level",
        "Upright frame that yaws and heights are counted in, in robot_base",
        "robot_base",
    ),
)
