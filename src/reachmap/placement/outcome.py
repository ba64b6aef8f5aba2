"""Rounds a decision off: scan configuration, margins, runner-up."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.bin_fit import BinFit
from reachmap.errors import SceneError
from reachmap.geometry import yaw_transform
from reachmap.placement.candidates import Candidate
from reachmap.placement.decision import REMEDY, SETTLING, Decision
from reachmap.placement.exact import PlacedScene, Pose
from reachmap.placement.imaging import UNSEEN
from reachmap.placement.margins import margins
from reachmap.placement.question import Question
from reachmap.placement.sample import THIN, sample_of
from reachmap.placement.scan_choice import ScanChoice, choose_scan


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


def settle(question: Question, decision: Decision) -> Outcome:
    """Choose the best pose that can be imaged, and its scan configuration.

    Parameters
    ----------
    question : Question
    decision : Decision
        Its table gets a row for the chosen pose as seen from a new configuration,
        and reasons where there is none.

    Raises
    ------
    SceneError
        No pose that was mapped can be imaged.
    """
    rows = decision.table.rows
    for row in decision.ranked:
        question.evaluator.expect(SETTLING)
        scan = _scan(question, rows[row])
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
            margin=_margins(question, pose, scan.q),
        )
    raise SceneError(f"{question.loaded.source}: {UNSEEN}; {REMEDY}")


def _scan(question: Question, candidate: Candidate) -> ScanChoice | None:
    if not question.keep_scan:
        sample = sample_of(question.loaded.cell, THIN, question.is_open)
        placed = PlacedScene(question.moving, candidate.pose, sample)
        return choose_scan(placed, question.evaluator)
    assert candidate.score is not None
    q: FloatArray = np.array(question.scene.scan_configuration)
    return ScanChoice(q=q, score=candidate.score, is_new=False)


def _margins(question: Question, pose: Pose, q: FloatArray) -> dict[str, float]:
    """Margins with the arm at a scan configuration, the region left aside."""
    fit = BinFit(question.scene.robot, question.loaded, q)
    return margins(
        pose,
        q,
        lambda moved: fit.contact(yaw_transform(*moved)) is None,
        question.evaluator,
    )


def _paper_row(decision: Decision, row: int, chosen: int) -> int:
    """Row of the paper's choice; the chosen row if that is what was chosen."""
    return chosen if decision.paper == row else decision.paper
