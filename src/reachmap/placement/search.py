"""Searches x, y, z and yaw: predicted places, mapped exactly, then improved."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reachmap._typing import FloatArray
from reachmap.errors import SceneError
from reachmap.placement.decision import REMEDY, SETTLING, Decision, nowhere, paper_pose
from reachmap.placement.mapped.candidates import Candidate, CandidateTable
from reachmap.placement.mapped.evaluator import Evaluator
from reachmap.placement.mapped.exact import Pose
from reachmap.placement.mapped.imaging import UNSEEN
from reachmap.placement.predicted.places import apart_m, rank_key, spread_out
from reachmap.placement.predicted.region import AXES, Region
from reachmap.placement.problem import PlacementProblem
from reachmap.placement.steadying import steadied

TURNS_DEG = (45.0, 90.0, 135.0)
# The best may stand at the edge of what it can be; the second is for its runner-up.
PLACES_IMPROVED = 2
MOST_TURNS = PLACES_IMPROVED * len(TURNS_DEG)
# Poses found not to be imaged, until no more are tried; what is near is not tried.
MOST_UNSEEN = 40
NEAR_UNSEEN_M = 0.05


def decide_by_search(problem: PlacementProblem, top: int) -> Decision:
    """Search x, y, z and yaw.

    Parameters
    ----------
    problem : PlacementProblem
    top : int
        Different places that are mapped with the bin in the scene.

    Raises
    ------
    SceneError
        The bin can stand nowhere.
    """
    decision = Decision()
    finalists = _finalists(problem, top, decision.table)
    paper = paper_pose(problem)
    poses = [c.pose for c in finalists] + ([] if paper is None else [paper])
    problem.evaluator.expect(len(poses) + MOST_TURNS + REFINE_POSES + SETTLING)
    mapped = problem.exact(poses)
    scored = sorted((c for c in mapped if c.score is not None), key=rank_key)
    better = _improved(problem, scored[:PLACES_IMPROVED])
    mapped += problem.exact([pose for pose in better if pose not in poses])
    # The paper's rule knows of no support; where its bin floats it is compared alone.
    unfit = {paper} if paper is not None and problem.reason_against(paper) else set()
    steady = steadied(problem, [c for c in mapped if c.pose not in unfit])
    for candidate in {c.pose: c for c in [*mapped, *steady]}.values():
        row = decision.table.add(candidate)
        if candidate.pose == paper:
            decision.paper = row
    decision.rank([c.pose for c in steady], unfit)
    if not decision.ranked:
        raise SceneError(nowhere(problem, decision.table))
    return decision


def _finalists(
    problem: PlacementProblem, top: int, table: CandidateTable
) -> list[Candidate]:
    """Best places that can be imaged; all that were considered go into a table."""
    places = problem.predicted()
    unseen: list[Candidate] = []

    def can_be_imaged(candidate: Candidate) -> bool:
        if len(unseen) == MOST_UNSEEN or any(
            apart_m(candidate.pose, other.pose) < NEAR_UNSEEN_M for other in unseen
        ):
            return False
        seen = problem.can_be_imaged(candidate.pose)
        if not seen:
            unseen.append(candidate)
        return seen

    found = spread_out(places, top, problem.different_place_m, can_be_imaged)
    for place in places:
        is_unseen = any(place is other for other in unseen)
        table.add(Candidate(pose=place.pose, reason=UNSEEN) if is_unseen else place)
    if unseen and not found:
        why = problem.why_unseen(unseen[0].pose)
        raise SceneError(
            f"{problem.loaded.source}: {UNSEEN} at any of the {len(unseen)} best "
            f"places{f' ({why})' if why else ''}; look elsewhere with --heights or "
            f"--region, or {REMEDY}"
        )
    return found


def _improved(problem: PlacementProblem, starts: list[Candidate]) -> list[Pose]:
    """Better poses near some places: turned first, then the best of all moved."""
    if not starts:
        return []
    evaluator = problem.evaluator
    evaluator.expect(MOST_TURNS + REFINE_POSES + SETTLING)
    best = _turned(problem, starts)
    evaluator.expect(REFINE_POSES + SETTLING)
    moved = refine(
        min(best, key=rank_key),
        problem.start,
        problem.region,
        problem.reason_against,
        evaluator,
    )
    return list(dict.fromkeys([moved.pose, *(c.pose for c in best)]))


def _turned(problem: PlacementProblem, starts: list[Candidate]) -> list[Candidate]:
    """Each of some candidates, or a better one at the same place."""
    turns = {
        pose: start
        for start in starts
        for pose in (_with_turn(start.pose, turn, problem) for turn in TURNS_DEG)
        if not problem.reason_against(pose)
    }
    above = [
        start.score.score + MIN_GAIN_POINTS
        for start in turns.values()
        if start.score is not None
    ]
    found = problem.exact(list(turns), above=above)
    better = [c for c in found if c.score is not None]
    return [
        min([start, *(c for c in better if turns[c.pose] is start)], key=rank_key)
        for start in starts
    ]


def _with_turn(pose: Pose, turn_deg: float, problem: PlacementProblem) -> Pose:
    low = float(problem.region.low[3])
    yaw = low + (pose[3] + np.radians(turn_deg) - low) % np.pi
    return (*pose[:3], round(float(yaw), 9))


# About a square of the usual map and a step of yaw; one halving ends at 20 mm, which
# is finer than most bins are put down.
FIRST_STEPS = (0.04, 0.04, 0.04, np.radians(15.0))
ROUNDS = 4
HALVINGS = 1
# One test grasp in two thousand. With a quarter of a point the search ended half a
# point below the best worst case of the deep container; poses at the tool's limit are
# excluded by their bounds either way.
MIN_GAIN_POINTS = 0.05
REFINE_POSES = ROUNDS * 2 * len(AXES)


def refine(
    start: Candidate,
    q: FloatArray | None,
    region: Region,
    reason_against: Callable[[Pose], str],
    evaluator: Evaluator,
) -> Candidate:
    """Search around a pose, exactly: the best neighbour is the next start.

    Neighbours are one step away along one of x, y, z, yaw; when none is better, the
    step is halved, and when again none is, or after four rounds, the search ends. A
    neighbour whose bound is hardly above the score is not worth mapping.

    Parameters
    ----------
    start : Candidate
        With an exact score.
    q : array, shape (dof,), or None
        Scan configuration; see :meth:`Evaluator.evaluate`.
    region : Region
    reason_against : callable
        Why a pose is not feasible, "" if it is.
    evaluator : Evaluator

    Returns
    -------
    Candidate
        The best that was found, which may be the start.
    """
    best, steps, halvings = start, np.array(FIRST_STEPS), 0
    for _ in range(ROUNDS):
        poses = [
            pose
            for pose in _neighbours(best.pose, steps, region)
            if not reason_against(pose)
        ]
        assert best.score is not None
        found = evaluator.evaluate(poses, q, above=best.score.score + MIN_GAIN_POINTS)
        better = [
            Candidate(pose=pose, score=e.score, exact=True)
            for pose, e in zip(poses, found, strict=True)
            if e.score is not None
        ]
        champion = min([best, *better], key=rank_key)
        if champion is best:
            if halvings == HALVINGS:
                break
            steps, halvings = steps / 2, halvings + 1
        best = champion
    return best


def _neighbours(pose: Pose, steps: FloatArray, region: Region) -> list[Pose]:
    found: list[Pose] = []
    for k, name in enumerate(AXES):
        if region.fixed(name):
            continue
        for sign in (1.0, -1.0):
            moved = list(pose)
            moved[k] = round(moved[k] + sign * float(steps[k]), 9)
            if not region.outside(np.array(moved)):
                found.append((moved[0], moved[1], moved[2], moved[3]))
    return found
