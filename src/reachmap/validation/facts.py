"""A validation as JSON values; what is not finite is null."""

from __future__ import annotations

import dataclasses
from typing import Any

from reachmap.maps.bytes.to_json import json_ready
from reachmap.ranking.lookup.costs import status_name
from reachmap.ranking.lookup.table import TERMS
from reachmap.scans.measured import MEASURED
from reachmap.validation.cycles import CycleSummary
from reachmap.validation.judgement import JudgedList
from reachmap.validation.statistics import Confusion
from reachmap.validation.summary import (
    GroupSummary,
    ListSummary,
    OrderFigures,
    Validation,
)

FORMAT = "reachmap.validation"
FORMAT_VERSION = "1.0"


def facts_of(
    validation: Validation, body_pairs: tuple[str, ...] | None = None
) -> dict[str, Any]:
    """Everything about a validation.

    Parameters
    ----------
    validation : Validation
    body_pairs : tuple of str, optional
        Names of the blocking pairs. With them, every grasp is listed.
    """
    facts: dict[str, Any] = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        **validation.settings,
        "lists": [_list_facts(one) for one in validation.summaries],
        "groups": [_group_facts(one) for one in validation.groups],
        "reliability": {
            name: dataclasses.asdict(found)
            for name, found in validation.reliability.items()
        },
        **(
            {"cycles": [_cycle_facts(c) for c in validation.cycles]}
            if validation.cycles
            else {}
        ),
        "reliability_diagram": dataclasses.asdict(validation.diagram),
    }
    if body_pairs is not None:
        facts["grasps"] = [
            _grasp_facts(one, row, body_pairs)
            for one in validation.lists
            for row in range(len(one.ids))
        ]
    return dict(json_ready(facts))


def _list_facts(one: ListSummary) -> dict[str, Any]:
    return {
        "list": one.label,
        "grasps": one.grasps,
        "confusion": _confusion_facts(one.confusion),
        "recommended": dataclasses.asdict(one.recommended),
        "correlation": dataclasses.asdict(one.correlation),
        "repeatability": dataclasses.asdict(one.repeatability),
    }


def _cycle_facts(one: CycleSummary) -> dict[str, Any]:
    return {
        "list": one.label,
        "confusion": _confusion_facts(one.confusion),
        "correlation": dataclasses.asdict(one.correlation),
        "orders": {name: dataclasses.asdict(of) for name, of in one.orders.items()},
    }


def _confusion_facts(confusion: Confusion) -> dict[str, Any]:
    shares = ("precision", "recall", "false_positive_rate", "agreement")
    return {
        **dataclasses.asdict(confusion),
        **{name: dataclasses.asdict(getattr(confusion, name)) for name in shares},
    }


def _group_facts(one: GroupSummary) -> dict[str, Any]:
    return {
        "group": one.label,
        "grasps": one.grasps,
        "cheaper": one.cheaper,
        "orders": {name: _order_facts(of) for name, of in one.orders.items()},
    }


def _order_facts(figures: OrderFigures) -> dict[str, Any]:
    facts = {f.name: getattr(figures, f.name) for f in dataclasses.fields(figures)}
    facts["terms"] = dict(zip(TERMS, figures.terms, strict=True))
    return facts


def _cycle_of_grasp(one: JudgedList, row: int) -> dict[str, Any]:
    if one.cycles is None:
        return {}
    return {
        "cycle": {
            "predicted_s": one.cycles.predicted_s[row],
            "measured_s": one.cycles.measured_s[row],
            "status": status_name(one.cycles.status[row]),
        }
    }


def _grasp_facts(
    one: JudgedList, row: int, body_pairs: tuple[str, ...]
) -> dict[str, Any]:
    results = one.results
    pair = int(results.blocking_pair[row])
    return {
        "list": one.label,
        "id": one.ids[row],
        "predicted": {
            "status": status_name(one.predicted_status[row]),
            "cost": one.predicted_cost[row],
            "probability": one.probability[row],
        },
        "measured": {
            "status": status_name(results.status[row]),
            "cost": one.cost[row],
            "terms": dict(zip(TERMS, one.terms[row], strict=True)),
            **dict(zip(MEASURED, one.measured[row], strict=True)),
        },
        **_cycle_of_grasp(one, row),
        "attempts": results.found.shape[1],
        "successes": int(results.found[row].sum()),
        "tool_poses": int(results.poses[row]),
        "tool_poses_free": int(results.poses_free[row]),
        "recommended_free": bool(results.recommended_free[row]),
        "recommended_reached": bool(one.reached_as_recommended[row]),
        "checks": int(results.checks[row].sum()),
        "hit_time_limit": bool(results.hit_time_limit[row].any()),
        "blocking_pair": body_pairs[pair] if pair >= 0 else None,
    }
