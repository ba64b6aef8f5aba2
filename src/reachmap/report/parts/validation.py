"""The section on the validation: predictions of the map against planning."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reachmap.report.blocks import (
    Heading,
    Section,
    Table,
    paragraph,
    section,
    table,
)
from reachmap.report.ranked_rows import known_number
from reachmap.text import NONE, number, percent, signed

SHARES = {
    "precision": "precision (called reachable and reached)",
    "recall": "recall (reached and called reachable)",
    "false_positive_rate": "false-positive rate",
}


def validation_section(facts: Mapping[str, Any]) -> Section:
    """Figures of a ``validation.json``.

    Parameters
    ----------
    facts : mapping
        As :mod:`reachmap.validation.facts` writes it; what is absent is left out.
    """
    lists, groups = (_mappings(facts.get(name)) for name in ("lists", "groups"))
    words = {"repeats": "attempts at each", "rolls": "rolls where the roll is free"}
    said = ", ".join(
        f"{name}: {facts[key]}" for key, name in words.items() if key in facts
    )
    cheaper = sum(bool(group.get("cheaper")) for group in groups)
    return section(
        "validation",
        "The map tested against planning",
        paragraph(
            "A path was planned to every grasp, and the outcome compared with the "
            f"map's prediction{f' ({said})' if said else ''}. Intervals are 95 % "
            "(Wilson)."
        ),
        _list_table(lists),
        Heading("The first grasps in each order, as measured") if groups else "",
        _group_table(groups) if groups else "",
        paragraph(
            "The re-ranked first grasps are cheaper than the supplied ones in "
            f"{cheaper} of {len(groups)} groups."
        )
        if groups
        else "",
    )


def _list_table(lists: list[dict[str, Any]]) -> Table:
    rows = []
    for one in lists:
        confusion = _mapping(one, "confusion")
        rank = known_number(_mapping(one, "correlation").get("spearman"))
        rows.append(
            (
                str(one.get("list", "")),
                one.get("grasps", NONE),
                *(_share_text(_mapping(confusion, name)) for name in SHARES),
                NONE if rank is None else signed(rank, 2),
            )
        )
    head = ("list", "grasps", *SHARES.values(), "order of J (Spearman)")
    return table(head, rows, "<>>>>>")


def _share_text(share: Mapping[str, Any]) -> str:
    known = [known_number(share.get(name)) for name in ("share", "low", "high")]
    said = [None if value is None else 100.0 * value for value in known]
    if said[0] is None:
        return NONE
    return f"{percent(said[0])} ({number(said[1], 1)} to {number(said[2], 1)})"


def _group_table(groups: list[dict[str, Any]]) -> Table:
    rows = []
    for group in groups:
        label: object = str(group.get("group", ""))
        for name, figures in _mapping(group, "orders").items():
            if not isinstance(figures, dict):
                continue
            rows.append(
                (
                    label,
                    str(name),
                    " of ".join(
                        str(figures.get(key, NONE)) for key in ("reached", "considered")
                    ),
                    number(known_number(figures.get("cost")), 3),
                    number(known_number(figures.get("path_length")), 2),
                    number(_milli(figures.get("planning_time")), 1),
                    number(known_number(figures.get("execution_time")), 2),
                    number(known_number(figures.get("calls_first")), 2),
                )
            )
            label = ""
    head = ("group", "order", "reached", "J", "path [rad]", "planning [ms]",
            "execution [s]", "planner calls to the first")  # fmt: skip
    return table(head, rows, "<<>>>>>>")


def _milli(value: Any) -> float | None:
    known = known_number(value)
    return None if known is None else 1e3 * known


def _mapping(parent: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = parent.get(key)
    return value if isinstance(value, dict) else {}


def _mappings(value: Any) -> list[dict[str, Any]]:
    items = value if isinstance(value, list) else []
    return [item for item in items if isinstance(item, dict)]
