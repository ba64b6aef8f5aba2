"""The decision of ``place-bin`` as text."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from reachmap.maps import BinPlacement
from reachmap.tools.place_bin import best_rows, placement_facts, row_facts


def placement_lines(placement: BinPlacement, output: Path, top: int) -> Iterator[str]:
    """Lay the decision out for people."""
    roles = {
        placement.paper_choice: "paper's rule",
        placement.runner_up: "runner-up",
        placement.chosen: "chosen",
    }
    rows = best_rows(placement, top)
    rows += [k for k in (placement.runner_up, placement.paper_choice) if k not in rows]
    yield "      x       y       z   yaw           score  worst case  worst point"
    for row in rows:
        facts = row_facts(placement, row)
        if facts is not None:
            yield _row_text(facts, roles.get(row, ""))
    facts = placement_facts(placement)
    if facts["figure"] == "directions":
        yield "score: reachability of directions, since the tool's roll does not matter"
    if placement.margin:
        yield "margin (score within 5 points): " + _margin_text(facts)
    yield from _stand(facts)
    limit = facts["tool_limit_percent"]
    if limit is not None and limit < 100:
        yield from _limit(facts)
    yield (
        f"{facts['candidates']} poses considered, {facts['mapped_with_bin']} mapped "
        f"with the bin in the scene, {facts['excluded']} excluded"
    )
    yield str(output)


def _stand(facts: dict[str, Any]) -> Iterator[str]:
    """Support of the bin, and the tolerance of the worst case."""
    if facts["support"] is not None:
        stands = facts["support"]
        yield (
            f"the bin stands on {stands}"
            if stands
            else ("the bin floats: no body of the cell is under it")
        )
    tolerance = facts["tolerance"]
    if tolerance and any(tolerance.values()):
        yield (
            f"worst case: the bin off by {1000 * tolerance['shift_m']:.0f} mm and "
            f"{tolerance['turn_deg']:g}°"
        )


def _limit(facts: dict[str, Any]) -> Iterator[str]:
    """Limit set by the tool itself, and the dimensions that would raise it."""
    body = facts["tool_limit_body"] or "the tool"
    yield (
        f"no pose can score more than {facts['tool_limit_percent']:.1f}%: the tool "
        f"itself collides with the bin ({body} most)"
    )
    gains = [
        f"{name} +{points:.1f} points"
        for name, points in (facts["tool_limit_gains"] or {}).items()
        if points >= 0.05
    ]
    short = facts["tool_limit_percent"] - facts["chosen"]["score_percent"]
    error = facts["chosen"].get("score_error_points") or 0.0
    if gains and short <= error:
        yield "the tool is the limit here; 20 mm more would give: " + ", ".join(gains)


def _row_text(facts: dict[str, Any], role: str) -> str:
    x, y, z = facts["xyz_m"]
    pose = f"{x:+7.3f} {y:+7.3f} {z:+7.3f} {facts['yaw_deg']:4.0f}°"
    if facts["score_percent"] is None:
        return f"{pose}  {facts.get('reason', '')}  {role}".rstrip()
    return (
        f"{pose} {facts['score_percent']:6.1f}{_error(facts)}% {_worst(facts)} "
        f"{facts['worst_point_percent']:10.1f}%  {role}"
    ).rstrip()


def _error(facts: dict[str, Any]) -> str:
    error = facts.get("score_error_points")
    return " " * 7 if error is None else f" ± {error:4.2f}"


def _worst(facts: dict[str, Any]) -> str:
    worst = facts.get("worst_case_percent")
    return f"{'-':>11}" if worst is None else f"{worst:10.1f}%"


def _margin_text(facts: dict[str, Any]) -> str:
    shifts = [f"{k} {1000 * v:.0f} mm" for k, v in facts["margin_m"].items()]
    turns = [f"{k} {v:.0f}°" for k, v in facts["margin_deg"].items()]
    return ", ".join([*shifts, *turns])
