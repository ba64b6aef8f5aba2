"""The headline of a placement, for people and for machines."""

from __future__ import annotations

from typing import Any

import numpy as np

from reachmap.maps.records import BinPlacement

TOOL_LIMIT = ("tool_limit_percent", "tool_limit_body", "tool_limit_gains")


def placement_facts(placement: BinPlacement) -> dict[str, Any]:
    """Everything that decides, as JSON values.

    Returns
    -------
    dict
        ``rule``, ``chosen``, ``runner_up``, ``paper`` (rows, or None), ``margin``,
        ``figure`` ("frames", or "directions" where the roll does not matter),
        ``scan_configuration``, counts of candidates, and ``tool_limit_percent``, the
        share of test grasps that the tool itself can take in this bin, with the body
        that is in the way and what 20 mm of a dimension would give back [points].
    """
    settings = placement.provenance.settings.get("placement", {})
    excluded = sum(1 for reason in placement.reason if reason)
    return {
        "rule": placement.rule,
        "support": placement.support,
        "tolerance": tolerance_facts(placement),
        "chosen": row_facts(placement, placement.chosen),
        "runner_up": row_facts(placement, placement.runner_up),
        "paper": row_facts(placement, placement.paper_choice),
        "margin_m": {
            k: round(v, 4) for k, v in placement.margin.items() if "yaw" not in k
        },
        "margin_deg": {
            k: round(float(np.degrees(v)), 2)
            for k, v in placement.margin.items()
            if "yaw" in k
        },
        "scan_configuration_rad": {
            name: round(float(value), 6)
            for name, value in zip(
                placement.joint_names, placement.scan_configuration, strict=True
            )
        },
        "candidates": len(placement.reason),
        "mapped_with_bin": int((placement.exact > 0).sum()),
        "excluded": excluded,
        "figure": settings.get("figure", "frames"),
        **{name: settings.get(name) for name in TOOL_LIMIT},
    }


def tolerance_facts(placement: BinPlacement) -> dict[str, float] | None:
    """Shift [m] and turn [deg] that the worst case is taken over, None before 1.1."""
    if placement.tolerance is None:
        return None
    shift_m, turn_rad = placement.tolerance
    return {"shift_m": shift_m, "turn_deg": round(float(np.degrees(turn_rad)), 4)}


def row_facts(placement: BinPlacement, row: int) -> dict[str, Any] | None:
    """Pose and score of a candidate; None for row -1."""
    if row < 0:
        return None
    x, y, z, yaw = placement.candidate_pose[row].tolist()
    facts: dict[str, Any] = {
        "xyz_m": [round(v, 4) + 0.0 for v in (x, y, z)],
        "yaw_deg": round(float(np.degrees(yaw)), 2) + 0.0,
    }
    for name, values in (
        ("score_percent", placement.score),
        ("worst_point_percent", placement.worst_point),
        ("reachable_percent", placement.reachable_share),
        ("worst_case_percent", placement.worst_score),
        ("score_error_points", placement.score_error),
    ):
        if values is None:
            continue
        value = float(values[row])
        facts[name] = None if np.isnan(value) else round(value, 2)
    if placement.reason[row]:
        facts["reason"] = placement.reason[row]
    return facts


def best_rows(placement: BinPlacement, count: int) -> list[int]:
    """Rows mapped with the bin in the scene, best first, one for each pose.

    Of a pose that was scored from two scan configurations, the chosen row counts.
    """
    rows = [
        k for k in np.flatnonzero(placement.exact) if not np.isnan(placement.score[k])
    ]
    rows.sort(key=lambda k: (k != placement.chosen, -placement.score[k], k))
    seen: set[tuple[float, ...]] = set()
    best: list[int] = []
    for row in rows:
        pose = tuple(np.round(placement.candidate_pose[row], 6).tolist())
        if pose not in seen:
            seen.add(pose)
            best.append(int(row))
    return best[:count]
