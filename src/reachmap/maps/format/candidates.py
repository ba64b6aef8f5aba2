"""What placements of bins and of robot bases share about their candidates."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

import numpy as np

from reachmap.maps.bytes.tree import Tree
from reachmap.maps.format.checks import require
from reachmap.maps.format.layout import Variable


class Chosen(Protocol):
    """A record that excludes candidates for reasons, and states a margin."""

    @property
    def reason(self) -> Sequence[str]:
        """Why each candidate is excluded, "" where it is not."""

    @property
    def margin(self) -> Any:
        """Direction, such as "+x" or "-yaw", to how far [m or rad]."""


def of_candidate(
    name: str, dtype: str, units: str, meaning: str, **more: Any
) -> Variable:
    """A number of each candidate."""
    return Variable(
        path=name,
        dims=("candidate",),
        dtype=dtype,
        units=units,
        meaning=meaning,
        **more,
    )


REASON: Final = of_candidate(
    "reason",
    "i4",
    "1",
    "Why the candidate is excluded, an index into reasons; 0: it is not.",
    low=0,
    labels="reasons",
    is_index=True,
)


def margin_variables(shift: str, turn: str) -> tuple[Variable, Variable]:
    """Margins of shifts [m] and turns [rad], with their meanings."""
    by_name = (("shift", "m", shift), ("turn", "rad", turn))
    first, second = (
        Variable(
            path=f"{name}_margin",
            dims=(name,),
            dtype="f8",
            units=units,
            meaning=meaning,
            low=0.0,
        )
        for name, units, meaning in by_name
    )
    return first, second


def row_problems(tree: Tree, least: dict[str, int]) -> list[str]:
    """Check root attributes that are rows of the candidates, from ``least`` on."""
    rows = {name: tree.attributes.get(name) for name in least}
    count = len(tree.array("score"))
    return [
        f"the root attribute {name} must be a row of the candidates"
        for name, row in rows.items()
        if not isinstance(row, int) or not least[name] <= row < count
    ]


def reason_problems(tree: Tree) -> list[str]:
    """Check that just the candidates with a reason have no score."""
    return require(
        np.isnan(tree.array("score")) == (tree.array("reason") != 0),
        "reason must be given exactly where a candidate has no score",
    )


def packed(record: Chosen) -> tuple[dict[str, Any], dict[str, Sequence[str]]]:
    """Arrays of reasons and margins, and the lists that name what they hold."""
    reasons = ("", *sorted(set(record.reason) - {""}))
    shift = {k: v for k, v in record.margin.items() if not is_turn(k)}
    turn = {k: v for k, v in record.margin.items() if is_turn(k)}
    arrays = {
        "reason": np.array([reasons.index(text) for text in record.reason], np.int64),
        "shift_margin": np.array(list(shift.values()), float),
        "turn_margin": np.array(list(turn.values()), float),
    }
    labels: dict[str, Sequence[str]] = {
        "reasons": reasons,
        "shift_directions": tuple(shift),
        "turn_directions": tuple(turn),
    }
    return arrays, labels


def unpacked(tree: Tree) -> dict[str, Any]:
    """Fields ``reason`` and ``margin`` of a record."""
    margin: dict[str, float] = {}
    for name in ("shift", "turn"):
        directions = tree.leaves[name].attributes[f"{name}_directions"]
        values = tree.array(f"{name}_margin").tolist()
        margin |= dict(zip(directions, values, strict=True))
    reasons = tree.attributes["reasons"]
    reason = tuple(str(reasons[code]) for code in tree.array("reason"))
    return {"reason": reason, "margin": margin}


def shown_margin(margin: Mapping[str, float]) -> dict[str, float]:
    """Margin with its turns in degrees: direction to how far [m or deg]."""
    return {
        direction: float(np.degrees(value)) if is_turn(direction) else float(value)
        for direction, value in margin.items()
    }


def excluded_counts(reason: Sequence[str]) -> dict[str, int]:
    """Reasons to exclude candidates with their counts, the most frequent first."""
    return dict(Counter(text for text in reason if text).most_common())


def is_turn(direction: str) -> bool:
    """Whether a direction of the margin is an angle, as "+yaw" is."""
    return direction.lstrip("+-") in ("roll", "pitch", "yaw")
