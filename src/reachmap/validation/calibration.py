"""Calibration of a map's predictions, and the calibration error of probabilities.

The curve is an isotonic regression (pool adjacent violators: R. E. Barlow et al.,
"Statistical inference under order restrictions", 1972) of reached or not over the share
that the map reaches around a grasp.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.optimize import isotonic_regression

from reachmap._typing import BoolArray, FloatArray
from reachmap.errors import SettingsError
from reachmap.ranking.lookup.probability import Calibration
from reachmap.validation.statistics import Share, share_of

# Customary: ten bins for a reliability diagram, five folds for a cross-validation.
BINS: Final = 10
FOLDS: Final = 5
# Fewer leave the rate of the least bin good to hardly 0.1.
LEAST_GRASPS: Final = 50
# Grasps that a knot stands for at least: its rate is then good to about 0.1.
KNOT_GRASPS: Final = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityBin:
    """Grasps whose probability lies in a tenth of the scale."""

    low: float
    high: float
    predicted: float
    reached: Share


@dataclass(frozen=True, slots=True, kw_only=True)
class ReliabilityDiagram:
    """Predicted probabilities against observed frequencies.

    Attributes
    ----------
    grasps : int
        Those with a probability.
    error : float
        Expected calibration error: mean over grasps of the distance between mean
        probability and frequency in their bin; NaN without grasps.
    brier : float
        Mean square of probability minus outcome.
    bins : tuple of ReliabilityBin
        Bins of the scale from 0 to 1 that have grasps.
    """

    grasps: int
    error: float
    brier: float
    bins: tuple[ReliabilityBin, ...]


def reliability_diagram(
    probability: FloatArray, reached: BoolArray
) -> ReliabilityDiagram:
    """Compare probabilities (n,), NaN for none, with outcomes of grasps (n,)."""
    known = ~np.isnan(probability)
    p, hit = probability[known], reached[known]
    number = np.minimum((p * BINS).astype(int), BINS - 1)
    bins = tuple(
        ReliabilityBin(
            low=k / BINS,
            high=(k + 1) / BINS,
            predicted=float(p[number == k].mean()),
            reached=share_of(int(hit[number == k].sum()), int((number == k).sum())),
        )
        for k in np.unique(number).tolist()
    )
    gaps = [one.reached.total * abs(one.predicted - one.reached.share) for one in bins]
    total = len(p)
    return ReliabilityDiagram(
        grasps=total,
        error=sum(gaps) / total if total else float("nan"),
        brier=float(((p - hit) ** 2).mean()) if total else float("nan"),
        bins=bins,
    )


def calibrate(
    map_sha256: str,
    share: FloatArray,
    reached: BoolArray,
    origin: Mapping[str, Any],
) -> Calibration:
    """Fit the curve from the share reached around grasps to their probability.

    Parameters
    ----------
    map_sha256 : str
    share : array, shape (n,)
        NaN for grasps that the map says nothing about; they are left out.
    reached : bool array, shape (n,)
    origin : mapping
        How the grasps were planned to, as JSON values.

    Raises
    ------
    SettingsError
        There are too few grasps.
    """
    known = ~np.isnan(share)
    share, reached = share[known], reached[known]
    check_number(len(share))
    left_out = np.empty(len(share))
    for fold in range(FOLDS):
        out = np.arange(len(share)) % FOLDS == fold
        left_out[out] = np.interp(share[out], *_curve(share[~out], reached[~out]))
    knots, probability = _curve(share, reached)
    return Calibration(
        map_sha256=map_sha256,
        share=knots,
        probability=probability,
        grasps=len(share),
        reached=int(reached.sum()),
        error=reliability_diagram(left_out, reached).error,
        origin=dict(origin),
    )


def check_number(grasps: int) -> None:
    """Raise SettingsError where too few grasps lie within the map."""
    if grasps < LEAST_GRASPS:
        raise SettingsError(
            f"--calibrate: needs {LEAST_GRASPS} grasps or more within the map "
            f"(got {grasps}); add some with --random"
        )


def _curve(share: FloatArray, reached: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Knots of the curve: mean share of neighbours in order, and their rate."""
    order = np.argsort(share, kind="stable")
    count = max(1, len(share) // KNOT_GRASPS)
    parts = np.array_split(order, count)
    sizes = np.array([len(part) for part in parts], float)
    hits = np.array([reached[part].sum() for part in parts], float)
    begin = isotonic_regression(hits / sizes, weights=sizes).blocks[:-1]
    count_of, hits_of = np.add.reduceat(sizes, begin), np.add.reduceat(hits, begin)
    # Half a success and half a failure added (Jeffreys): no rate is exactly 0 or 1.
    rate_of = isotonic_regression((hits_of + 0.5) / (count_of + 1.0), weights=count_of)
    fit = np.repeat(rate_of.x, np.diff([*begin, len(parts)]))
    at = np.array([share[part].mean() for part in parts])
    at, first = np.unique(at, return_index=True)
    return at, np.asarray(fit[first])
