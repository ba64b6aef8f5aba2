"""Among good poses the one that stays good when the bin ends up a little off it."""

from __future__ import annotations

import dataclasses

import numpy as np

from reachmap.placement.mapped.candidates import Candidate
from reachmap.placement.predicted.places import rank_key
from reachmap.placement.problem import Question
from reachmap.placement.tolerance import (
    Tolerance,
    WorstCase,
    away_from_losses,
    worst_case,
)

# Poses whose neighbours are looked at, how far below the best they may score, and
# how often each of them is moved away from what its neighbours lose.
TRIED, BELOW_POINTS, MOVES = 3, 3.0, 2
# Lost by a neighbour, this is the sample's noise.
NOISE_POINTS = 0.5
# What a margin may cost, as everywhere; equal within this are worst cases at least.
MARGIN_POINTS, LEAST_ERROR = 5.0, 0.1


def steadied(question: Question, mapped: list[Candidate]) -> list[Candidate]:
    """Poses with their worst cases, the one to be chosen first.

    The best few are looked at with their neighbours, and each is moved away from what
    its neighbours lose. Of worst cases that are equal within the error
    of the scores the widest margin decides, then the shorter paths, then how square the
    bin stands.

    Parameters
    ----------
    question : Question
    mapped : list of Candidate
        Mapped with the bin in the scene.
    """
    tolerance = question.tolerance
    scored = sorted((c for c in mapped if c.score is not None), key=rank_key)
    if tolerance.is_none or not scored or scored[0].score is None:
        return []
    least = scored[0].score.score - BELOW_POINTS
    near = [c for c in scored if c.score is not None and c.score.score >= least]
    found: list[tuple[Candidate, WorstCase]] = []
    for candidate in near[:TRIED]:
        found.append(_looked_at(question, candidate))
        for _ in range(MOVES):
            worst = found[-1][1]
            best = max(worst.score for _, worst in found)
            moved = _moved(question, *found[-1], above=best)
            if moved is None:
                break
            found.append(_looked_at(question, moved))
            if found[-1][1].score <= worst.score:
                break
    return _in_order(question, [candidate for candidate, _ in found])


def worst_of(question: Question, candidate: Candidate) -> WorstCase:
    """Worst case of a pose under the tolerance asked for."""
    return _worst(question, candidate, question.tolerance)


def _looked_at(question: Question, candidate: Candidate) -> tuple[Candidate, WorstCase]:
    worst = worst_of(question, candidate)
    return dataclasses.replace(candidate, worst=worst.score), worst


def _worst(question: Question, candidate: Candidate, tolerance: Tolerance) -> WorstCase:
    return worst_case(
        candidate,
        tolerance,
        question.start,
        lambda pose: question.fit.contact(question.T_base_bin(pose)) is None,
        question.evaluator,
    )


def _moved(
    question: Question, candidate: Candidate, worst: WorstCase, *, above: float
) -> Candidate | None:
    """A candidate further from its losses, mapped exactly.

    None where it cannot be, or where it cannot score above a worst case.
    """
    pose = away_from_losses(candidate.pose, question.tolerance, worst, NOISE_POINTS)
    if pose is None or question.reason_against(pose):
        return None
    if not question.can_be_imaged(pose):
        return None
    (moved,) = question.exact([pose], above=above) or (None,)
    return moved if moved is not None and moved.score is not None else None


def _in_order(question: Question, found: list[Candidate]) -> list[Candidate]:
    """Candidates with worst cases, equal ones by margin, paths and squareness."""
    found = sorted(found, key=lambda c: (-(c.worst or 0.0), rank_key(c)))
    best = found[0]
    assert best.worst is not None
    assert best.score is not None
    error = max(float(np.nan_to_num(best.score.error)), LEAST_ERROR)
    equal = [c for c in found if (c.worst or 0.0) >= best.worst - error]
    if len(equal) > 1:
        equal.sort(key=lambda c: _preference(question, c))
    return equal + [c for c in found if c not in equal]


def _preference(question: Question, candidate: Candidate) -> tuple[float, ...]:
    assert candidate.score is not None
    wide = question.tolerance.widened()
    lost = float(_worst(question, candidate, wide).lost.max(initial=0.0))
    off_square = abs((candidate.pose[3] + np.pi / 4) % (np.pi / 2) - np.pi / 4)
    return (
        max(lost - MARGIN_POINTS, 0.0),
        round(candidate.score.path_length_rad, 2),
        round(off_square, 3),
    )
