"""Settings of the planner and of path simplification."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from reachmap.cell.fields import NonNegative, Positive, Record

PlannerName = Literal[
    "LBKPIECE1", "BKPIECE1", "KPIECE1", "RRTConnect", "RRT", "RRTstar", "PRM",
    "PRMstar", "BITstar", "FMT", "BFMT", "InformedRRTstar", "SORRTstar", "AORRTC",
]  # fmt: skip


class SimplificationSpec(Record):
    """How a found path is shortened; budgets count tries, never seconds."""

    method: Literal["shortcut", "simplify_max", "none"] = "shortcut"
    rounds: int = Field(3, ge=1, le=1000)
    tries: int = Field(20, ge=0, le=100000)


class PlannerSpec(Record):
    """The planner, its budget in state checks, and its safety net in seconds."""

    name: PlannerName = "LBKPIECE1"
    range_rad: Positive | None = Field(0.5, description="Longest motion it adds.")
    max_checks: int = Field(20000, ge=1, description="Work budget of one attempt.")
    time_limit_s: Positive = Field(
        60.0, description="Safety net; recorded when it ends an attempt."
    )
    goal_bias: NonNegative | None = Field(None, le=1)
    simplification: SimplificationSpec = SimplificationSpec()
