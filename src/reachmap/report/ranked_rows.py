"""Ranked grasp lists as rows; missing values stay empty."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from reachmap.ranking.answers.ranked_list import TERM_NAMES

SECONDS: Final = re.compile(r"[a-z][a-z_]{0,40}_s")
"""Names of terms in predicted seconds: stages are what a map calls them."""
# A choice against hostile input, beyond the terms of any cost.
MOST_TERMS: Final = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class RankedRow:
    """One grasp of a ranked list.

    Attributes
    ----------
    name : str
        Its id, or its number in the supplied order.
    quadrant : str
    rank, original_rank : int or None
    cost : float or None
        J, or seconds per pick; None where it is not reached.
    terms : mapping
        Summands of the cost by name.
    status : str
    """

    name: str
    quadrant: str
    rank: int | None
    original_rank: int | None
    cost: float | None
    terms: Mapping[str, float]
    status: str


def known_number(value: Any) -> float | None:
    """A finite number, or None for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def cost_of_list(document: Mapping[str, Any]) -> str:
    """What a ranked list is ordered by: ``cycle``, else ``paper``."""
    return "cycle" if document["reachmap"].get("cost") == "cycle" else "paper"


def ranked_rows(document: Mapping[str, Any]) -> list[RankedRow]:
    """Rows of a ranked list, in its order; grasps that were not ranked are left out."""
    return [
        _row(grasp, grasp["reachmap"])
        for grasp in document["grasps"]
        if isinstance(grasp, dict) and isinstance(grasp.get("reachmap"), dict)
    ]


def weights_of(document: Mapping[str, Any]) -> list[float]:
    """Weights of the terms of J, if the list has them."""
    weights = document["reachmap"].get("weights")
    if not isinstance(weights, list):
        return []
    return [w for value in weights if (w := known_number(value)) is not None]


def _row(grasp: Mapping[str, Any], result: Mapping[str, Any]) -> RankedRow:
    before = _whole(result.get("original_rank"))
    terms = result.get("terms")
    named = terms if isinstance(terms, dict) else {}
    known = {
        name: known_number(value)
        for name, value in list(named.items())[:MOST_TERMS]
        if name in TERM_NAMES or SECONDS.fullmatch(name)
    }
    return RankedRow(
        name=str(grasp.get("id") or f"no. {before or '?'}"),
        quadrant=str(grasp.get("quadrant") or ""),
        rank=_whole(result.get("rank")),
        original_rank=before,
        cost=known_number(result.get("cost")),
        terms={name: value for name, value in known.items() if value is not None},
        status=str(result.get("status", "")).replace("_", " "),
    )


def _whole(value: Any) -> int | None:
    number = known_number(value)
    return None if number is None else int(number)
