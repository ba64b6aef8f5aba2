"""A scan configuration that sees the whole bin, and from which paths are short."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import islice

import numpy as np

from reachmap._typing import FloatArray
from reachmap.placement.mapped.evaluator import Evaluator
from reachmap.placement.mapped.exact import PlacedScene, PoseScore
from reachmap.placement.mapped.imaging import imaging_configurations

# Each is scored by mapping the bin, so few.
FINALISTS = 6
# Scores of the sample this close are equal; the shorter paths decide.
EQUAL_POINTS = 0.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScanChoice:
    """A configuration to image the bin from.

    Attributes
    ----------
    q : array, shape (dof,)
        [rad].
    score : PoseScore
        Of the bin, seen from it.
    is_new : bool
        Whether it differs from the cell's own.
    """

    q: FloatArray
    score: PoseScore
    is_new: bool


def choose_scan(placed: PlacedScene, evaluator: Evaluator) -> ScanChoice | None:
    """Find the best configuration that images the bin at a pose.

    Among the few that promise the shortest paths, the highest score wins; of scores
    within half a point the shortest mean path.

    Parameters
    ----------
    placed : PlacedScene
        Of a cell with a camera on the tool, or one that stands.
    evaluator : Evaluator

    Returns
    -------
    ScanChoice or None
        None if no configuration images the bin.
    """
    found = imaging_configurations(placed.scene, *placed.grasps)
    finalists = list(islice(found, FINALISTS))
    if not finalists:
        return None
    own = placed.scene.scan_configuration
    if np.array_equal(finalists[0], own):
        # A camera that stands sees the bin past the arm as the cell has it.
        finalists = [own]
    mapped = evaluator.evaluate([placed.pose] * len(finalists), np.array(finalists))
    scored = [
        (e.score, q)
        for e, q in zip(mapped, finalists, strict=True)
        if e.score is not None
    ]
    if not scored:
        return None
    best = max(score.score for score, _ in scored)
    near = [pair for pair in scored if pair[0].score >= best - EQUAL_POINTS]
    score, q = min(near, key=lambda pair: pair[0].path_length_rad)
    return ScanChoice(q=q, score=score, is_new=not np.array_equal(q, own))
