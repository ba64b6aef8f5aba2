"""Choice among good poses of the one that tolerates a misplaced bin best."""

from __future__ import annotations

import dataclasses

import numpy as np

from reachmap.placement.mapped.candidates import Candidate
from reachmap.placement.mapped.exact import NEVER, Pose
from reachmap.placement.mapped.sample import QUICK
from reachmap.placement.predicted.places import rank_key
from reachmap.placement.problem import PlacementProblem
from reachmap.placement.tolerance import (
    NOISE_POINTS,
    ROOM,
    WorstCase,
    away_from_losses,
    confirmed_worst,
    moved_by,
    worst_case,
)

# Poses whose neighbours are looked at, how far below the best they may score, and
# how often each of them is moved away from what its neighbours lose.
TRIED, BELOW_POINTS, MOVES = 2, 3.0, 1
# Confirmed loss from which a pose is nudged, a little more than one grasp of the thin
# sample counts in the shipped cell; how often; and how far [tolerances], so that what
# was lost at the edge of the tolerance has as much room as anywhere.
NUDGE_POINTS, NUDGES, NUDGE = 0.25, 2, ROOM - 1.0
# What a margin may cost, as everywhere; equal within this are worst cases at least.
MARGIN_POINTS, LEAST_ERROR = 5.0, 0.1


def steadied(problem: PlacementProblem, mapped: list[Candidate]) -> list[Candidate]:
    """Poses with their worst cases, the one to be chosen first.

    The best few are looked at with their neighbours, and each is moved away from what
    its neighbours lose. Of worst cases that are equal within the error
    of the scores the widest margin decides, then the shorter paths, then how square the
    bin stands. The worst case of the first is confirmed with more test grasps, and the
    pose nudged away from what that shows; where it was too high, those of its rivals
    are confirmed, too.

    Parameters
    ----------
    problem : PlacementProblem
    mapped : list of Candidate
        Mapped with the bin in the scene.
    """
    tolerance = problem.tolerance
    scored = sorted((c for c in mapped if c.score is not None), key=rank_key)
    if tolerance.is_none or not scored or scored[0].score is None:
        return []
    least = scored[0].score.score - BELOW_POINTS
    near = [c for c in scored if c.score is not None and c.score.score >= least]
    found: list[tuple[Candidate, WorstCase]] = []
    for candidate in near[:TRIED]:
        found.append(_looked_at(problem, candidate))
        for _ in range(MOVES):
            worst = found[-1][1]
            best = max(worst.score for _, worst in found)
            moved = _moved(problem, *found[-1], above=best)
            if moved is None:
                break
            found.append(_looked_at(problem, moved))
            if found[-1][1].score <= worst.score:
                break
    return _confirmed(
        problem, _in_order(problem, [found_one for found_one, _ in found])
    )


def stated_worst(problem: PlacementProblem, candidate: Candidate) -> float:
    """Worst case of a pose under the tolerance asked for, confirmed [percent]."""
    return _confirmed_worst(problem, candidate).score


def _confirmed_worst(problem: PlacementProblem, candidate: Candidate) -> WorstCase:
    worst = worst_of(problem, candidate)
    if worst.score == 0.0:
        return worst
    return confirmed_worst(
        candidate, worst, problem.tolerance, problem.start, problem.evaluator
    )


def worst_of(problem: PlacementProblem, candidate: Candidate) -> WorstCase:
    """Worst case of a pose under the tolerance asked for."""
    return worst_case(
        candidate,
        problem.tolerance,
        problem.start,
        lambda pose: not problem.obstruction(pose),
        problem.evaluator,
    )


def _looked_at(
    problem: PlacementProblem, candidate: Candidate
) -> tuple[Candidate, WorstCase]:
    worst = worst_of(problem, candidate)
    return dataclasses.replace(candidate, worst=worst.score), worst


def _moved(
    problem: PlacementProblem,
    candidate: Candidate,
    worst: WorstCase,
    *,
    above: float,
    slack: float = NOISE_POINTS,
    by: float = ROOM,
) -> Candidate | None:
    """A candidate further from its losses, mapped exactly.

    None where it cannot be, or where it cannot score above a worst case.
    """
    pose = away_from_losses(candidate.pose, problem.tolerance, worst, slack, by)
    if pose is None or problem.reason_against(pose):
        return None
    if not problem.can_be_imaged(pose):
        return None
    (moved,) = problem.exact([pose], above=above) or (None,)
    return moved if moved is not None and moved.score is not None else None


def _in_order(problem: PlacementProblem, found: list[Candidate]) -> list[Candidate]:
    """Candidates with worst cases, equal ones by margin, paths and squareness."""
    found = sorted(found, key=lambda c: (-(c.worst or 0.0), rank_key(c)))
    best = found[0]
    assert best.worst is not None
    equal = [c for c in found if (c.worst or 0.0) >= best.worst - _error(best)]
    others = [c for c in found if c not in equal]
    return [*_by_margin(problem, equal), *others]


def _confirmed(problem: PlacementProblem, rivals: list[Candidate]) -> list[Candidate]:
    """Candidates with the worst case of the first, and of its rivals, confirmed.

    One after the other, until no other promises more than the best that is confirmed.
    """
    confirmed: list[Candidate] = []
    for k, candidate in enumerate(rivals):
        best = max((c.worst or 0.0 for c in confirmed), default=0.0)
        confirmed.append(_nudged(problem, candidate, best))
        best = max(c.worst or 0.0 for c in confirmed)
        if all((c.worst or 0.0) <= best + _error(candidate) for c in rivals[k + 1 :]):
            break
    # As they were among equals.
    first = next(c for c in confirmed if (c.worst or 0.0) >= best - _error(c))
    others = [c for c in confirmed if c is not first]
    return [first, *others, *rivals[len(confirmed) :]]


def _nudged(problem: PlacementProblem, candidate: Candidate, least: float) -> Candidate:
    """A candidate with its worst case confirmed, or a better one close to it.

    It is nudged away from what its neighbours lose, unless it is not the best anyhow.
    """
    worst = _confirmed_worst(problem, candidate)
    here = best = dataclasses.replace(candidate, worst=worst.score)
    for _ in range(NUDGES):
        is_behind = worst.score < max(least, best.worst or 0.0, LEAST_ERROR)
        if is_behind or worst.lost.max() < NUDGE_POINTS:
            break
        moved = _moved(
            problem, here, worst, above=worst.score, slack=NUDGE_POINTS, by=NUDGE
        )
        if moved is None:
            break
        worst = _confirmed_worst(problem, moved)
        here = dataclasses.replace(moved, worst=worst.score)
        best = max(best, here, key=lambda c: c.worst or 0.0)
    return best


def _error(candidate: Candidate) -> float:
    """Worst cases are equal within this [points]."""
    assert candidate.score is not None
    return max(float(np.nan_to_num(candidate.score.error)), LEAST_ERROR)


def _by_margin(problem: PlacementProblem, equal: list[Candidate]) -> list[Candidate]:
    """Candidates of one worst case, those with a wide margin first.

    Those with short paths are looked at first; one that loses nothing in any direction
    ends the search.
    """
    if len(equal) < 2:
        return equal
    in_turn = sorted(equal, key=_tie_key)
    lost: dict[Pose, int] = {}
    for candidate in in_turn:
        lost[candidate.pose] = _directions_lost(problem, candidate)
        if lost[candidate.pose] == 0:
            break
    most = len(problem.tolerance.steps())
    return sorted(in_turn, key=lambda c: lost.get(c.pose, most))


def _tie_key(candidate: Candidate) -> tuple[float, float]:
    """Shorter paths first, to a tenth of a radian, then how square the bin stands."""
    assert candidate.score is not None
    off_square = abs((candidate.pose[3] + np.pi / 4) % (np.pi / 2) - np.pi / 4)
    return round(candidate.score.path_length_rad, 1), round(off_square, 3)


def _directions_lost(problem: PlacementProblem, candidate: Candidate) -> int:
    """In how many directions a step beyond the tolerance costs more than a margin.

    Counted by the frames with a free configuration, which takes a fraction of the time
    of paths and approaches; the margin of what is chosen is measured with them.
    """
    poses = [moved_by(candidate.pose, step) for step in problem.tolerance.steps()]
    possible = [pose for pose in poses if not problem.obstruction(pose)]
    problem.evaluator.expect(1 + len(possible))
    here, *found = problem.evaluator.evaluate(
        [candidate.pose, *possible], problem.start, above=NEVER, grid=QUICK
    )
    held = [e.bound >= here.bound - MARGIN_POINTS for e in found]
    return len(poses) - sum(held)
