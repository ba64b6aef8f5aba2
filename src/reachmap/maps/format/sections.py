"""What files of version 1.1 may have besides: evidence, effort, margins, cycle."""

from __future__ import annotations

from typing import Any, Final

from reachmap.maps.format.layout import (
    NONNEGATIVE,
    PERCENT,
    Section,
    Variable,
    index,
)
from reachmap.maps.parts import (
    ApproachTimes,
    BestPaths,
    Components,
    Cycle,
    Effort,
    Margins,
    StageStatus,
)

_POINT = ("layer", "y", "x")
_GRASP = (*_POINT, "orientation")
_TRY = (*_GRASP, "repeat")
_STAGE = (*_GRASP, "stage")
_ONE: Final[dict[str, Any]] = {"units": "1"}
_POSE_SCALES = (
    index("pose_row", "Rows of a homogeneous matrix."),
    index("pose_column", "Columns of a homogeneous matrix."),
)


def _variable(
    path: str, dims: tuple[str, ...], dtype: str, meaning: str, **more: Any
) -> Variable:
    return Variable(path=path, dims=dims, dtype=dtype, meaning=meaning, **more)


def _component(name: str, dtype: str, meaning: str, **more: Any) -> Variable:
    return _variable(
        f"components/{name}", ("component",), dtype, meaning, **_ONE, **more
    )


def _pose(name: str, meaning: str, frame: str, *, with_scales: bool = False) -> Section:
    """One pose; with scales where the rest of the file has no pose."""
    return Section(
        field=name,
        scales=_POSE_SCALES if with_scales else (),
        arrays={
            name: _variable(
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
        "method_checks": _variable(
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
        "component": _variable(
            "component",
            _GRASP,
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
        "direction_reachability": _variable(
            "direction_reachability",
            _POINT,
            "f8",
            "Share of approach directions with a path for at least one roll.",
            nan=True,
            **PERCENT,
        ),
        "point_reachability": _variable(
            "point_reachability",
            _POINT,
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
        "winning_roll": _variable(
            "winning_roll",
            _GRASP,
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
        "checks": _variable(
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
    return _variable(name, _GRASP, "f8", meaning, units=units, **NONNEGATIVE)


BEST = Section(
    field="best",
    part=BestPaths,
    arrays={
        "row": _variable(
            "best_path",
            _GRASP,
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
        "effort_checks": _variable(
            "best_effort_checks",
            _GRASP,
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
        "approach": _variable(
            "approach_time",
            _TRY,
            "f8",
            "Time optimum of the straight approach, a part of execution_time; "
            "NaN where no path was found.",
            units="s",
            **NONNEGATIVE,
        ),
        "retreat": _variable(
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
        "clearance_pair": _variable(
            "clearance_pair",
            _GRASP,
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


def _stage(name: str, dtype: str, meaning: str, **more: Any) -> Variable:
    return _variable(f"cycle/{name}", _STAGE, dtype, meaning, **more)


CYCLE = Section(
    field="cycle",
    part=Cycle,
    scales=(index("cycle/stage", "Stages after the grasp.", labels="stages"),),
    lists={"stages": "stages"},
    arrays={
        "status": _stage(
            "stage_status", "u1", "Outcome of the stage.", codes=StageStatus, **_ONE
        ),
        "blocking_pair": _stage(
            "stage_blocking_pair",
            "i4",
            "The two bodies in collision, an index into body_pairs; -1: none.",
            low=-1,
            labels="body_pairs",
            is_index=True,
            **_ONE,
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
        "drop_off": _variable(
            "cycle/drop_off",
            _GRASP,
            "i4",
            "Where the part goes, counted as in the cell; -1: nowhere.",
            low=-1,
            **_ONE,
        ),
        "cycle_time": _variable(
            "cycle/cycle_time",
            _GRASP,
            "f8",
            "Time of the whole cycle; NaN unless every stage has a path.",
            units="s",
            **NONNEGATIVE,
        ),
        "reachability": _variable(
            "cycle/cycle_reachability",
            _POINT,
            "f8",
            "Share of test grasps with a whole cycle, Eq. (1).",
            nan=True,
            **PERCENT,
        ),
    },
)

STAGE_OF_PATH = Section(
    field="paths.stage",
    arrays={
        "stage": _variable(
            "paths/stage",
            ("path",),
            "u1",
            "0: to the grasp; 1, 2, …: the stages of the cycle, in order.",
            **_ONE,
        )
    },
)

BIN_SECTIONS = (
    COMPONENT, COMPONENTS, CONFIDENCE, ROLLS, WINNING_ROLL, EFFORT, BEST, TIMES,
    MARGINS, CYCLE, STAGE_OF_PATH, world(),
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
            "tolerance": _variable(
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
                name: _variable(
                    name, ("candidate",), "f8", meaning, nan=True, **PERCENT
                )
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
