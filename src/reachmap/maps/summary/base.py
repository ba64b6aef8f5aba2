"""Summary of a robot placement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap.maps.base.record import BasePlacement
from reachmap.maps.format.candidates import (
    excluded_counts,
    is_turn,
    shown_margin,
)
from reachmap.text import plural


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseCandidate:
    """One place: position in the world [m] (x: that on the rail), scores [percent]."""

    row: int
    arm: str
    mounting: str
    x: float
    y: float
    z: float
    yaw_deg: float
    score: float
    score_error: float
    worst_point: float
    reachable_share: float
    exact: bool
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseSummary:
    """Summary of a robot placement.

    Attributes
    ----------
    rail : str
        Joint whose position was sought, or "".
    chosen : BaseCandidate
    runner_up, present : BaseCandidate or None
        The best elsewhere or of another arm or mounting; the cell as it is.
    best_of : tuple of BaseCandidate
        Best of each arm and mounting.
    gain, gain_error : float or None
        Chosen minus present [points], and the standard error; None where there is no
        score to compare with.
    margin : mapping
        Direction to how far the base may be off [m], or turned [deg], before the score
        drops by 5 points.
    scan_configuration : mapping
        Joint to position [rad; m for a prismatic joint].
    candidates, exact : int
        Places that were considered, and those that paths were planned from.
    excluded : mapping
        Reason to number of places, the most frequent first.
    """

    rail: str
    chosen: BaseCandidate
    runner_up: BaseCandidate | None
    present: BaseCandidate | None
    best_of: tuple[BaseCandidate, ...]
    gain: float | None
    gain_error: float | None
    margin: dict[str, float]
    scan_configuration: dict[str, float]
    candidates: int
    exact: int
    excluded: dict[str, int]


def summarise_base(placement: BasePlacement) -> BaseSummary:
    """Put scores, gain over the present place, margin and causes into numbers."""
    chosen = _candidate(placement, placement.chosen)
    present = _row(placement, placement.present)
    gain = gain_error = None
    if present is not None and present.exact:
        gain = chosen.score - present.score
        gain_error = float(np.hypot(chosen.score_error, present.score_error))
    return BaseSummary(
        rail=placement.rail,
        chosen=chosen,
        runner_up=_row(placement, placement.runner_up),
        present=present,
        best_of=tuple(
            _candidate(placement, int(row))
            for row in placement.best_of.ravel()
            if row >= 0
        ),
        gain=gain,
        gain_error=gain_error,
        margin=shown_margin(placement.margin),
        scan_configuration=dict(
            zip(
                placement.joint_names,
                placement.scan_configuration.tolist(),
                strict=True,
            )
        ),
        candidates=len(placement.reason),
        exact=int((placement.exact > 0).sum()),
        excluded=excluded_counts(placement.reason),
    )


def _row(placement: BasePlacement, row: int) -> BaseCandidate | None:
    return None if row < 0 else _candidate(placement, row)


def _candidate(placement: BasePlacement, row: int) -> BaseCandidate:
    x, y, z = placement.candidate_position[row].tolist()
    return BaseCandidate(
        row=row,
        arm=placement.arms[int(placement.arm[row])],
        mounting=placement.mountings[int(placement.mounting[row])],
        x=x,
        y=y,
        z=z,
        yaw_deg=float(np.degrees(placement.candidate_yaw[row])),
        score=float(placement.score[row]),
        score_error=float(placement.score_error[row]),
        worst_point=float(placement.worst_point[row]),
        reachable_share=float(placement.reachable_share[row]),
        exact=bool(placement.exact[row]),
        reason=placement.reason[row],
    )


def place_text(candidate: BaseCandidate, rail: str) -> str:
    """Position in the world, ``x +0.040  y …  yaw 0°``, or that on the rail."""
    if rail:
        return f"{rail} = {candidate.x:.3f} m"
    return (
        f"x {candidate.x:+.3f}  y {candidate.y:+.3f}  z {candidate.z:+.3f} m  "
        f"yaw {candidate.yaw_deg:.0f}°"
    )


def score_text(candidate: BaseCandidate) -> str:
    """Score with its 95 % interval, ``96.3 ± 0.5 %``; the cause without one."""
    if np.isnan(candidate.score):
        return candidate.reason
    return f"{candidate.score:.1f} ± {1.96 * candidate.score_error:.1f} %"


def margin_text(margin: dict[str, float], rail: str) -> str:
    """Margins of the base as text; those of a rail are named after the joint."""

    def named(direction: str) -> str:
        return f"{rail} {direction.removeprefix('x')}" if rail else direction

    return ", ".join(
        f"{k} {v:.0f}°" if is_turn(k) else f"{named(k)} {1000 * v:.0f} mm"
        for k, v in margin.items()
    )


def base_sentences(placement: BasePlacement) -> list[str]:
    """Result of the search, line by line; the headline first."""
    summary = summarise_base(placement)
    lines = [
        f"{place_text(summary.chosen, summary.rail)} · {score_text(summary.chosen)}"
    ]
    if summary.gain is not None and summary.gain_error is not None:
        half = 1.96 * summary.gain_error
        sure = abs(summary.gain) > half
        said = "" if sure else "not distinguishable from the cell as it is, "
        lines.append(
            f"{said}{summary.gain:+.1f} ± {half:.1f} points against the cell as it is"
            if sure
            else f"{said}{summary.gain:+.1f} ± {half:.1f} points"
        )
    if summary.runner_up is not None:
        lines.append(
            f"runner-up: {place_text(summary.runner_up, summary.rail)}, "
            f"{score_text(summary.runner_up)}"
        )
    if summary.margin:
        lines.append(
            f"margin for 5 points: {margin_text(summary.margin, summary.rail)}"
        )
    lines.append(
        f"{plural(summary.candidates, 'place')} considered, {summary.exact} with paths"
    )
    return lines
