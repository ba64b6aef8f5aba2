"""Settings of the planner, of path simplification, and of the roadmap."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

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


Checks = Annotated[int, Field(ge=1, le=10**9)]
Few = Annotated[int, Field(ge=1, le=1000)]


class RoadmapSpec(Record):
    """Search effort for connecting frames to the scan configuration."""

    planners: tuple[PlannerName, ...] = Field(
        ("LBKPIECE1", "RRTConnect"),
        min_length=1,
        max_length=8,
        description="OMPL planners, in turn: what one misses another may find.",
    )
    max_checks: Checks = Field(
        20000, description="State checks of each planner for a component."
    )
    range_rad: Positive = Field(
        0.5, description="Longest motion that a planner adds [rad]."
    )
    projection_cell_rad: Positive = Field(
        1.0, description="Cells that guide a KPIECE planner [rad]."
    )
    goals_per_plan: Few = Field(
        16, description="Goals of a plan, spread over the open frames."
    )
    starts_per_plan: Few = Field(
        4,
        description="Configurations a plan may start from: the scan configuration, and "
        "reached ones near its goals.",
    )
    samples: int = Field(
        10000,
        ge=0,
        le=10**6,
        description="Configurations of the lazy roadmap around what stays open; for an "
        "arm of n joints at most 10^n.",
    )
    sample_checks: Checks = Field(
        60000,
        description="State checks of the lazy roadmap for a component; an eighth of "
        "that for each once three times as many are spent.",
    )
    sample_neighbours: Few = Field(
        14, description="Neighbours of a configuration of the lazy roadmap."
    )
    neighbours: Few = Field(8, description="Neighbours a goal may be connected to.")
    start_neighbours: Few = Field(
        64, description="Neighbours of the scan configuration."
    )
    longest_motion_rad: Positive = Field(
        2.2, description="Longest change of a joint between neighbours [rad]."
    )
    straight_tries: Few = Field(
        12, description="Straight motions tried to a component before planning."
    )

    route_goals: Few = Field(
        24, description="Goals of the network of routes, spread over those reached."
    )
    route_plans: int = Field(
        36, ge=0, le=1000, description="Plans that add routes to the network."
    )
    route_rounds: int = Field(
        2, ge=0, le=20, description="Rounds of joining and shortening its routes."
    )
    ways: Few = Field(3, description="Paths to a goal of which the shortest is kept.")
    way_tries: Few = Field(
        100, description="Motions tried from the network to the goals of a frame."
    )
    least_gain: Positive = Field(
        0.01,
        lt=1,
        description="A path is shortened until 15 tries gain less than this share.",
    )

    @model_validator(mode="after")
    def _planners_differ(self) -> RoadmapSpec:
        if len(set(self.planners)) < len(self.planners):
            raise ValueError(f"planners repeat: {', '.join(self.planners)}")
        return self
