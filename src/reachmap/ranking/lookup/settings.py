"""Settings of a ranking: weights, likeness, margins, neighbours, roll."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from numbers import Integral, Real
from typing import Any, Final, Literal, TypeAlias

from reachmap.errors import SettingsError

Normaliser: TypeAlias = Literal["quantile", "max"]
NORMALISERS: Final[tuple[Normaliser, ...]] = ("quantile", "max")
PlanningTime: TypeAlias = Literal["checks", "measured"]
PLANNING_TIMES: Final[tuple[PlanningTime, ...]] = ("checks", "measured")
# Of 0.9, 0.95, 0.99 and 1, chosen on simulated heaps: docs/reference/conventions.md.
QUANTILE: Final = 0.95
Invalid: TypeAlias = Literal["mark", "raise"]
INVALIDS: Final[tuple[Invalid, ...]] = ("mark", "raise")
# A grasp is like a test grasp up to half a step in each of three rotations, 0.9 steps
# in all; a step and a half allows for families with uneven steps.
ALIKE_STEPS: Final = 1.5
Roll: TypeAlias = Literal["as-given", "free", "fixed"]
ROLLS: Final[tuple[Roll, ...]] = ("as-given", "free", "fixed")
# A choice: beyond it the other terms are lost; EVEN is what the paper takes.
MAX_WEIGHT: Final = 1e6
EVEN: Final = (1.0, 1.0, 1.0)
# A choice that bounds the memory of a look-up.
MAX_NEIGHBOURS: Final = 64
Cost: TypeAlias = Literal["paper", "cycle"]
COSTS: Final[tuple[Cost, ...]] = ("paper", "cycle")
# A choice: more than a day of penalty is a mistake.
MAX_FAILURE_S: Final = 1e5
MARGINS: Final = ("clearance", "joint_margin", "singularity", "wind_up")
"""Optional terms of J: what a path leaves, and how far it winds the wrist up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CostBasis:
    """Definition of the terms of J; it belongs to the table, not to one request.

    Attributes
    ----------
    normalise : {"quantile", "max"}
        What each mean is divided by: its 95 % quantile over the path-reachable test
        grasps, so that no single one sets the scale, or its maximum, as in the paper.
    planning_time : {"checks", "measured"}
        State checks at a nominal cost each, which depend on the map alone, or the CPU
        time that was measured, as in the paper. A map without counts of checks has
        measured times only.
    """

    normalise: Normaliser = "quantile"
    planning_time: PlanningTime = "checks"

    def __post_init__(self) -> None:
        mistakes = [
            f"{name} must be one of {', '.join(known)} (got {value!r})"
            for name, value, known in (
                ("normalise", self.normalise, NORMALISERS),
                ("planning time", self.planning_time, PLANNING_TIMES),
            )
            if value not in known
        ]
        if mistakes:
            raise SettingsError(mistakes)


@dataclass(frozen=True, slots=True, kw_only=True)
class RankSettings:
    """Order of grasps, and matching of test grasps.

    Attributes
    ----------
    cost : {"paper", "cycle"}
        paper: J = α φ3 + β φ4 + δ φ5 + ε φ6 + Σ μ_k φ_k; cycle: predicted seconds per
        pick, which nothing is weighed in.
    failure_cost_s : float or None
        What a failed pick costs where cost is cycle [s]; None: the median cycle of
        the map.
    weights : (float, float, float)
        α, β, δ of path length, planning time and execution time.
    likeness : float
        ε of the distance to the test grasp; 0 is the paper's J.
    margins : mapping
        Weights μ of the terms in ``MARGINS``, by name; those left out weigh 0.
    neighbours : int
        Test points of which the median cost is taken; 1 is the paper's nearest.
    roll : {"as-given", "free", "fixed"}
        Whether the roll about the approach counts. As given: it does for grasps
        with a full orientation and not for those with a direction.
    max_angle_deg : float or None
        Largest φ2 at which a grasp counts as like its test grasp; beyond, the map
        says nothing about it. None: 1.5 times the spacing of the map's orientations.
    invalid : {"mark", "raise"}
        How to treat rows that are not finite or lack a direction or a rotation.
    """

    cost: Cost = "paper"
    failure_cost_s: float | None = None
    weights: tuple[float, float, float] = EVEN
    likeness: float = 0.0
    margins: Mapping[str, float] = field(default_factory=dict)
    neighbours: int = 1
    roll: Roll = "as-given"
    max_angle_deg: float | None = None
    invalid: Invalid = "mark"

    def __post_init__(self) -> None:
        weights, margins = _items(self.weights), self.margins
        if len(weights) != 3:
            raise SettingsError(f"three weights are needed (got {self.weights!r:.80})")
        if not _is_mapping(margins):
            raise SettingsError(f"margins are weights by name (got {margins!r:.80})")
        named = zip(("alpha", "beta", "delta"), weights, strict=True)
        problems = [_weight_problem(name, value) for name, value in named]
        problems.append(_weight_problem("likeness", self.likeness))
        problems += [_weight_problem(*item) for item in margins.items()]
        if unknown := [name for name in margins if name not in MARGINS]:
            problems.append(f"margins are {', '.join(MARGINS)} (got {unknown})")
        if not (_is_whole(self.neighbours) and 1 <= self.neighbours <= MAX_NEIGHBOURS):
            problems.append(
                f"neighbours must be 1 to {MAX_NEIGHBOURS} (got {self.neighbours!r})"
            )
        if self.roll not in ROLLS:
            problems.append(f"roll must be one of {', '.join(ROLLS)} ({self.roll!r})")
        if self.invalid not in INVALIDS:
            problems.append(f"invalid must be mark or raise (got {self.invalid!r})")
        limit = self.max_angle_deg
        if limit is not None and not 0 < _real(limit) <= 180:
            problems.append(f"max_angle_deg must be above 0, to 180 (got {limit!r})")
        if not any((*weights, self.likeness, *margins.values())):
            problems.append("one weight at least must be above 0")
        problems += self._cost_problems()
        mistakes = [problem for problem in problems if problem]
        if mistakes:
            raise SettingsError(mistakes)
        object.__setattr__(self, "weights", tuple(map(float, weights)))

    def _cost_problems(self) -> list[str]:
        """Settings that contradict the requested cost."""
        failure_s = self.failure_cost_s
        if self.cost not in COSTS:
            return [f"cost must be one of {', '.join(COSTS)} (got {self.cost!r})"]
        if self.cost == "paper":
            return ["failure_cost_s needs cost cycle"] if failure_s is not None else []
        problems = []
        weighed = any((self.likeness, *self.margins.values()))
        if weighed or _items(self.weights) != EVEN:
            problems.append("cost cycle is in seconds: weights belong to cost paper")
        if self.neighbours != 1:
            problems.append("cost cycle is of the nearest test grasp: neighbours is 1")
        if failure_s is not None and not 0 <= _real(failure_s) <= MAX_FAILURE_S:
            problems.append(
                f"failure_cost_s must be 0 to {MAX_FAILURE_S:g} (got {failure_s!r})"
            )
        return problems


def _weight_problem(name: object, value: object) -> str:
    if 0 <= _real(value) <= MAX_WEIGHT:
        return ""
    return f"weight {name} must be between 0 and {MAX_WEIGHT:g} (got {value!r})"


def _real(value: object) -> float:
    """Value of a number, NaN for what is none."""
    return float(value) if isinstance(value, Real) else math.nan


def _is_whole(value: object) -> bool:
    return isinstance(value, Integral)


def _is_mapping(value: object) -> bool:
    return isinstance(value, Mapping)


def _items(value: object) -> tuple[Any, ...]:
    """Items of a sequence, none of what is not one."""
    return tuple(value) if isinstance(value, Iterable) else ()
