"""Summary of a bin placement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.format.candidates import excluded_counts, shown_margin
from reachmap.maps.records import BinPlacement
from reachmap.maps.summary.upright import name_of_frame


@dataclass(frozen=True, slots=True, kw_only=True)
class CandidateSummary:
    """One pose of the bin: position [m], yaw [deg], scores [percent]."""

    row: int
    x: float
    y: float
    z: float
    yaw_deg: float
    score: float
    worst_point: float
    reachable_share: float
    exact: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacementSummary:
    """Summary of a bin placement.

    Attributes
    ----------
    rule : str
    chosen : CandidateSummary
    runner_up, paper_choice : CandidateSummary or None
    margin : mapping
        Direction to how far the bin can move [m], or turn [deg], before the score
        drops by 5 points.
    scan_configuration_deg : mapping
        Joint to position.
    candidates, exact : int
        Poses that were considered, and those with the bin in the scene.
    excluded : mapping
        Reason to number of candidates, the most frequent first.
    tolerance_shift_m, tolerance_turn_deg, worst_score : float or None
        The chosen pose's least score while the bin is off by as much [percent].
    score_error : float or None
        Standard error of the chosen pose's score [percent].
    support : str or None
        Body that the bin stands on, "" if it stands on none.
    frame : str
        Frame that positions and yaws are in.
    """

    rule: str
    chosen: CandidateSummary
    runner_up: CandidateSummary | None
    paper_choice: CandidateSummary | None
    margin: dict[str, float]
    scan_configuration_deg: dict[str, float]
    candidates: int
    exact: int
    excluded: dict[str, int]
    tolerance_shift_m: float | None
    tolerance_turn_deg: float | None
    worst_score: float | None
    score_error: float | None
    support: str | None
    frame: str


def summarise_placement(record: BinPlacement) -> PlacementSummary:
    """Summarise the chosen pose, its margin and its alternatives."""
    degrees = np.degrees(record.scan_configuration)
    tolerance = record.tolerance
    turn_deg = None if tolerance is None else float(np.degrees(tolerance[1]))
    return PlacementSummary(
        rule=record.rule,
        chosen=_candidate(record, record.chosen),
        runner_up=_candidate_or_none(record, record.runner_up),
        paper_choice=_candidate_or_none(record, record.paper_choice),
        margin=shown_margin(record.margin),
        scan_configuration_deg=dict(
            zip(record.joint_names, degrees.tolist(), strict=True)
        ),
        candidates=len(record.score),
        exact=int(record.exact.sum()),
        excluded=excluded_counts(record.reason),
        tolerance_shift_m=None if tolerance is None else tolerance[0],
        tolerance_turn_deg=turn_deg,
        worst_score=_of_chosen(record, record.worst_score),
        score_error=_of_chosen(record, record.score_error),
        support=record.support,
        frame=name_of_frame(record.T_base_level, record.T_world_base),
    )


def _of_chosen(record: BinPlacement, values: FloatArray | None) -> float | None:
    return None if values is None else float(values[record.chosen])


def _candidate_or_none(record: BinPlacement, row: int) -> CandidateSummary | None:
    return _candidate(record, row) if row >= 0 else None


def _candidate(record: BinPlacement, row: int) -> CandidateSummary:
    x, y, z, yaw = (float(value) for value in record.candidate_pose[row])
    return CandidateSummary(
        row=row,
        x=x,
        y=y,
        z=z,
        yaw_deg=float(np.degrees(yaw)),
        score=float(record.score[row]),
        worst_point=float(record.worst_point[row]),
        reachable_share=float(record.reachable_share[row]),
        exact=bool(record.exact[row]),
    )
