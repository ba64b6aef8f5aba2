"""The poses that were considered, one row each, with their outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from reachmap._typing import CodeArray, FloatArray
from reachmap.placement.mapped.evaluator import Evaluation
from reachmap.placement.mapped.exact import Pose, PoseScore


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """One pose and its score, or the reason why it has none.

    Attributes
    ----------
    pose : tuple of float
        x, y, z [m], yaw [rad] of the bin in the cell's level frame.
    score : PoseScore or None
        None exactly where there is a reason.
    worst : float or None
        Least score under the tolerance [percent]; None where it was not looked for.
    exact : bool
        Whether the bin was in the scene.
    reason : str
    """

    pose: tuple[float, float, float, float]
    score: PoseScore | None = None
    worst: float | None = None
    exact: bool = False
    reason: str = ""


def mapped_candidates(
    poses: Sequence[Pose], found: Sequence[Evaluation]
) -> list[Candidate]:
    """Poses that were mapped, and those excluded for a reason; the rest is left out."""
    return [
        Candidate(pose=pose, score=e.score, exact=e.score is not None, reason=e.reason)
        for pose, e in zip(poses, found, strict=True)
        if e.score is not None or e.reason
    ]


@dataclass(slots=True, kw_only=True)
class CandidateTable:
    """Rows in the order in which they were added."""

    rows: list[Candidate] = field(default_factory=list)

    def add(self, candidate: Candidate) -> int:
        """Append a candidate; returns its row."""
        self.rows.append(candidate)
        return len(self.rows) - 1

    def poses(self) -> FloatArray:
        """Poses, shape (n, 4)."""
        return np.array([row.pose for row in self.rows], float).reshape(-1, 4)

    def values(self, name: str) -> FloatArray:
        """An attribute of the scores, shape (n,); NaN where there is none."""
        return np.array(
            [np.nan if r.score is None else getattr(r.score, name) for r in self.rows]
        )

    def worst(self) -> FloatArray:
        """Least scores under the tolerance, shape (n,); NaN where not looked for."""
        found = [row.worst for row in self.rows]
        return np.array([np.nan if w is None else w for w in found], float)

    def exact(self) -> CodeArray:
        """1 where the bin was in the scene, shape (n,)."""
        return np.array([row.exact for row in self.rows], np.uint8)

    def reasons(self) -> tuple[str, ...]:
        """Reason of each row, "" where it has a score."""
        return tuple(row.reason for row in self.rows)
