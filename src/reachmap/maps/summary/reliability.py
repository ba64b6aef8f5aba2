"""Whether a term of J is a property of the grasp, or chance in an attempt."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.maps.records import BinMap

# Below one half, most of the difference between two grasps is chance.
RELIABLE_SHARE = 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Reliability:
    """Variance of a measure between grasps and within them.

    Attributes
    ----------
    grasps : int
        Grasps with at least one successful attempt.
    repeated : int
        Those with at least two, without which chance cannot be estimated.
    between, within : float
        Variance of the grasps' true means, and of attempts at one grasp, in the
        measure's unit squared; NaN without repeated grasps.
    share : float
        Intraclass share: between / (between + within), that part of the variance of
        a single attempt which is the grasp. NaN without repeated grasps or variance.
    """

    grasps: int
    repeated: int
    between: float
    within: float
    share: float

    @property
    def is_noise(self) -> bool:
        """Whether most of the variance is chance."""
        return self.share < RELIABLE_SHARE


def reliability_of(values: FloatArray) -> Reliability:
    """Split a variance by a one-way analysis with random effects.

    Parameters
    ----------
    values : array, shape (grasps, attempts)
        NaN where an attempt failed; grasps may have different numbers of successes.

    Examples
    --------
    >>> reliability_of(np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]])).share
    1.0
    """
    known = ~np.isnan(values)
    values, known = values[known.any(axis=1)], known[known.any(axis=1)]
    count = known.sum(axis=1)
    grasps, repeated, total = len(count), int((count > 1).sum()), int(count.sum())
    if grasps < 2 or repeated == 0:
        nan = float("nan")
        return Reliability(
            grasps=grasps, repeated=repeated, between=nan, within=nan, share=nan
        )
    filled = np.where(known, values, 0.0)
    mean = filled.sum(axis=1) / count
    within = float((np.where(known, values - mean[:, None], 0.0) ** 2).sum())
    within /= total - grasps
    grand = float(filled.sum() / total)
    between_square = float((count * (mean - grand) ** 2).sum()) / (grasps - 1)
    size = (total - float((count**2).sum()) / total) / (grasps - 1)
    between = max(0.0, (between_square - within) / size)
    whole = between + within
    return Reliability(
        grasps=grasps,
        repeated=repeated,
        between=between,
        within=within,
        share=between / whole if whole > 0 else float("nan"),
    )


def term_reliability(record: BinMap) -> dict[str, Reliability]:
    """Reliability of the terms of J, and of the measured planning time.

    Keys are ``path_length``, ``effort_checks`` (where the map counts them),
    ``planning_cpu_time`` (where attempts are independent) and ``execution_time``.
    """
    found = record.path_found == 1
    measures = {"path_length": record.path_length}
    if record.effort is not None:
        checks = record.effort.checks.astype(float)
        measures["effort_checks"] = np.where(found, checks, np.nan)
    # Attempts that share their search share its time, which hides chance.
    if record.provenance.settings.get("attempts", "planner") != "roadmap":
        measures["planning_cpu_time"] = record.planning_cpu_time
    measures["execution_time"] = record.execution_time
    attempts = found.shape[-1]
    return {
        name: reliability_of(values.reshape(-1, attempts))
        for name, values in measures.items()
    }
