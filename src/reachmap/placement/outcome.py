"""Rounds a decision off: scan configuration, margins, runner-up."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.errors import SceneError
from reachmap.placement.candidates import Candidate
from reachmap.placement.decision import Decision, Question
from reachmap.placement.margins import margins
from reachmap.placement.scan_choice import ScanChoice, can_choose, choose_scan

POSES_TRIED = 5
UNSEEN = "no scan configuration images the bin"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """What becomes the artefact.

    Attributes
    ----------
    chosen, runner_up, paper_choice : int
        Rows of the table, -1 for none.
    scan : ScanChoice
    margin : dict
        See :func:`reachmap.placement.margins.margins`.
    """

    chosen: int
    runner_up: int
    paper_choice: int
    scan: ScanChoice
    margin: dict[str, float]


def settle(
    question: Question, decision: Decision, *, keep_scan: bool, tries: int = POSES_TRIED
) -> Outcome:
    """Choose the best pose that can be imaged, and its scan configuration.

    Parameters
    ----------
    question : Question
    decision : Decision
        Its table gets a row for the chosen pose as seen from a new configuration,
        and reasons where there is none.
    keep_scan : bool
        Whether the cell's own configuration stays; it also does where the cell has
        no camera on its tool.
    tries : int
        How many of the best poses may turn out not to be imaged.

    Raises
    ------
    SceneError
        No pose that was tried can be imaged.
    """
    rows = decision.table.rows
    keep_scan = keep_scan or not can_choose(question.scene)
    for row in decision.ranked[:tries]:
        scan = (
            _kept(question, rows[row]) if keep_scan else _searched(question, rows[row])
        )
        if scan is None:
            rows[row] = Candidate(pose=rows[row].pose, exact=True, reason=UNSEEN)
            continue
        pose = rows[row].pose
        chosen = row
        if scan.is_new:
            chosen = decision.table.add(
                dataclasses.replace(rows[row], score=scan.score)
            )
        return Outcome(
            chosen=chosen,
            runner_up=decision.runner_up(pose, question.different_place_m),
            paper_choice=_paper_row(decision, row, chosen),
            scan=scan,
            margin=margins(pose, scan.q, question.is_possible, question.evaluator),
        )
    raise SceneError(
        f"{question.loaded.source}: {UNSEEN} at any of the {min(tries, len(rows))} "
        "best poses; look at camera.range_m and camera.field_of_view_deg, or leave "
        "the cell's own with --keep-scan-configuration"
    )


def _kept(question: Question, candidate: Candidate) -> ScanChoice:
    assert candidate.score is not None
    q: FloatArray = np.array(question.scene.scan_configuration)
    return ScanChoice(q=q, score=candidate.score, is_new=False)


def _searched(question: Question, candidate: Candidate) -> ScanChoice | None:
    return choose_scan(question.loaded, candidate.pose, question.evaluator)


def _paper_row(decision: Decision, row: int, chosen: int) -> int:
    """Row of the paper's choice; the chosen row if that is what was chosen."""
    return chosen if decision.paper == row else decision.paper
