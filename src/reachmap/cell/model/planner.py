"""Settings of the planner and of path simplification."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from reachmap.cell.model.fields import GrowingRecord, NonNegative, Positive, Record

# PRM and PRMstar are left out: they search in a second thread, which waits for ever
# for the interpreter that the checks in the first one hold.
PlannerName = Literal[
    "LBKPIECE1", "BKPIECE1", "KPIECE1", "RRTConnect", "RRT", "RRTstar",
    "InformedRRTstar", "SORRTstar", "BITstar", "FMT", "BFMT", "AORRTC",
]  # fmt: skip

TimeLawName = Literal["trapezoid", "jerk", "blend", "toppra"]


class SimplificationSpec(Record):
    """How a found path is shortened; budgets count tries, never seconds."""

    method: Literal["shortcut", "simplify_max", "none"] = Field(
        "shortcut",
        description="shortcut: vertex reduction and shortcuts; simplify_max: OMPL's.",
    )
    tries: int = Field(40, ge=0, le=100000, description="Corners tried.")
    other_goals: bool = Field(
        True, description="End at another goal of the frame where that is shorter."
    )


class PlannerSpec(GrowingRecord):
    """The planner, its budget in state checks, and how its paths are timed."""

    later: ClassVar[tuple[str, ...]] = ("time_law",)

    name: PlannerName = Field("LBKPIECE1", description="OMPL geometric planner.")
    range_rad: Positive | None = Field(
        0.5, description="Longest motion it adds [rad]; null: the planner's default."
    )
    max_checks: int = Field(
        20000, ge=1, le=10**9, description="Work budget of one attempt, state checks."
    )
    straight_first: bool = Field(
        True,
        description="Try the straight motion to the nearest goal before searching: if "
        "it is free, no path is shorter.",
    )
    restart_checks: int | None = Field(
        150,
        ge=1,
        description="A search that found nothing after this many state checks starts "
        "over, each time with twice as many; null: it continues.",
    )
    time_limit_s: Positive = Field(
        60.0, description="Safety net [s]; recorded when it ends an attempt."
    )
    goal_bias: NonNegative | None = Field(
        None, le=1, description="Share of samples taken at a goal, where it has one."
    )
    projection_cell_rad: Positive | None = Field(
        1.0,
        description="Cells that guide a KPIECE planner, over the two joints that move "
        "the tool furthest [rad]; null: a random projection.",
    )
    simplification: SimplificationSpec = Field(
        SimplificationSpec(), description="How a found path is shortened."
    )
    time_law: TimeLawName = Field(
        "trapezoid",
        description="How motions are timed. trapezoid: at rest at every corner; jerk: "
        "the same with `robot.limits.jerk_rad_s3`; blend: corners blended as far as "
        "the blend is verified; toppra: the time optimum along those blends.",
    )
