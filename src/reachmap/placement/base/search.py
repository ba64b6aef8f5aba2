"""Search for a base pose: predicted places, mapped exactly, then refined."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.placement.base.lattice import base_lattice, smoothed
from reachmap.placement.base.problem import DIFFERENT_PLACE_M, BaseProblem
from reachmap.placement.decision import NO_ROW, SETTLING, Decision
from reachmap.placement.mapped.candidates import Candidate
from reachmap.placement.mapped.exact import Pose
from reachmap.placement.mapped.imaging import UNSEEN
from reachmap.placement.margins import margins
from reachmap.placement.predicted.places import rank_key, spread_out
from reachmap.placement.scan_choice import ScanChoice, choose_scan
from reachmap.placement.search import REFINE_POSES, refine

# Places that are asked whether they can be imaged, at most, for each that is mapped.
ASKED_PER_PLACE = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BaseOutcome:
    """Result of the search for one arm and mounting.

    Attributes
    ----------
    decision : Decision
    chosen, runner_up, present : int
        Rows of its table, -1 for none. Nothing is chosen where no place serves.
    scan : ScanChoice or None
    margin : dict
        See :func:`reachmap.placement.margins.margins`.
    """

    decision: Decision
    chosen: int
    runner_up: int
    present: int
    scan: ScanChoice | None
    margin: dict[str, float]


def search_base(problem: BaseProblem, reach: float, top: int) -> BaseOutcome:
    """Find the best place, a runner-up elsewhere, and how far the base may be off.

    Parameters
    ----------
    problem : BaseProblem
    reach : float
        See :func:`reachmap.placement.base.lattice.reach_m`.
    top : int
        Different places that are mapped exactly.
    """
    decision = Decision()
    finalists = _finalists(problem, reach, top, decision)
    own = problem.own
    asked = list(dict.fromkeys([*finalists, *([] if problem.contact(own) else [own])]))
    problem.evaluator.expect(len(asked) + REFINE_POSES + SETTLING)
    mapped = problem.exact(asked)
    inside = [
        c
        for c in mapped
        if c.score is not None and not problem.region.outside(np.array(c.pose))
    ]
    if inside:
        best = min(inside, key=rank_key)
        better = refine(
            best,
            problem.start,
            problem.region,
            problem.reason_against,
            problem.evaluator,
        )
        if better.pose != best.pose:
            mapped.append(better)
            inside.append(better)
    present = NO_ROW
    for candidate in mapped:
        row = decision.table.add(candidate)
        present = row if candidate.pose == own else present
    allowed = {c.pose for c in inside}
    decision.rank(unfit={c.pose for c in mapped if c.pose not in allowed})
    return _settled(problem, decision, present)


def _finalists(
    problem: BaseProblem, reach: float, top: int, decision: Decision
) -> list[Pose]:
    """Best places by their bounds, far from each other; all go into the table."""
    # x of an arm on a rail is no distance from the bin.
    is_free = problem.fit is not None
    poses = base_lattice(problem.region, problem.own, reach, around_bin=is_free)
    reasons = [problem.reason_against(pose) for pose in poses]
    free = [pose for pose, reason in zip(poses, reasons, strict=True) if not reason]
    problem.evaluator.expect(len(free) + top + REFINE_POSES + SETTLING)
    bounds = problem.bounds(free)
    for pose, reason in zip(poses, reasons, strict=True):
        if reason:
            decision.table.add(Candidate(pose=pose, reason=reason))
    for candidate in bounds:
        decision.table.add(candidate)
    if not bounds:
        return []
    promise = smoothed(free, [c.score.score if c.score else 0.0 for c in bounds])
    ranked = [
        dataclasses.replace(c, score=dataclasses.replace(c.score, score=float(value)))
        for c, value in zip(bounds, promise, strict=True)
        if c.score is not None and c.score.score > 0.0
    ]
    asked: list[Pose] = []

    def can_be_imaged(candidate: Candidate) -> bool:
        if len(asked) >= ASKED_PER_PLACE * top:
            return False
        asked.append(candidate.pose)
        return problem.can_be_imaged(candidate.pose)

    found = spread_out(ranked, top, DIFFERENT_PLACE_M, can_be_imaged)
    return [c.pose for c in found]


def _settled(problem: BaseProblem, decision: Decision, present: int) -> BaseOutcome:
    rows = decision.table.rows
    for row in decision.ranked:
        problem.evaluator.expect(SETTLING)
        pose = rows[row].pose
        scan = _scan(problem, rows[row])
        if scan is None:
            rows[row] = Candidate(pose=pose, exact=True, reason=UNSEEN)
            continue
        chosen = row
        if scan.is_new:
            scored = dataclasses.replace(rows[row], score=scan.score)
            chosen = decision.table.add(scored)
        if row == present:
            present = chosen
        return BaseOutcome(
            decision=decision,
            chosen=chosen,
            runner_up=decision.runner_up(pose, DIFFERENT_PLACE_M),
            present=present,
            scan=scan,
            margin=_margins(problem, pose, scan.q),
        )
    return BaseOutcome(
        decision=decision,
        chosen=NO_ROW,
        runner_up=NO_ROW,
        present=present,
        scan=None,
        margin={},
    )


def _scan(problem: BaseProblem, candidate: Candidate) -> ScanChoice | None:
    if not problem.keep_scan:
        return choose_scan(problem.placed(candidate.pose), problem.evaluator)
    assert candidate.score is not None
    return ScanChoice(q=problem.scan_configuration, score=candidate.score, is_new=False)


def _margins(problem: BaseProblem, pose: Pose, q: FloatArray) -> dict[str, float]:
    found = margins(
        pose, q, lambda moved: problem.is_possible(moved, q), problem.evaluator
    )
    # What is fixed has no margin that anybody could use.
    return {
        name: value
        for name, value in found.items()
        if problem.fit is not None or name.lstrip("+-") == "x"
    }
