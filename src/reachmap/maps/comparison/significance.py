"""Is a change more than chance: exact tests for shares of frames."""

from __future__ import annotations

import numpy as np
from scipy.special import bdtr, gammaln

from reachmap._typing import BoolArray, FloatArray, IntArray

# Outcomes as likely as the observed one count as at least as extreme, although the
# last bits of their likelihoods differ.
_TIE = 1e-7


def mcnemar_exact(gained: int, lost: int) -> float:
    """Two-sided exact p-value of McNemar's test for paired outcomes.

    Only frames whose outcome changed count; if nothing but chance changed them, each
    is as likely to be gained as lost.

    Examples
    --------
    >>> mcnemar_exact(0, 0), mcnemar_exact(5, 0)
    (1.0, 0.0625)
    """
    changed = gained + lost
    if changed == 0:
        return 1.0
    return float(min(1.0, 2.0 * bdtr(min(gained, lost), changed, 0.5)))


def fisher_exact(
    hits_a: IntArray, total_a: IntArray, hits_b: IntArray, total_b: IntArray
) -> FloatArray:
    """Two-sided p-values of Fisher's exact test, table by table.

    Parameters
    ----------
    hits_a, total_a, hits_b, total_b : int array, shape (n,)
        Frames reached, and frames tried, before and after.

    Returns
    -------
    array, shape (n,)
        1 where nothing was tried.
    """
    tables = np.stack([hits_a, total_a, hits_b, total_b], axis=-1).astype(np.int64)
    different, place = np.unique(tables, axis=0, return_inverse=True)
    values = np.array([_fisher(*(int(v) for v in row)) for row in different])
    return np.asarray(values[place.ravel()]) if len(tables) else np.zeros(0)


def _fisher(hits_a: int, total_a: int, hits_b: int, total_b: int) -> float:
    """Sum of the hypergeometric probabilities up to that of the table."""
    hits, total = hits_a + hits_b, total_a + total_b
    possible = np.arange(max(0, hits - total_b), min(hits, total_a) + 1)
    weight = _log_choose(total_a, possible) + _log_choose(total_b, hits - possible)
    probability = np.exp(weight - _log_choose(total, np.array(hits)))
    observed = probability[hits_a - possible[0]]
    return float(min(1.0, probability[probability <= observed * (1.0 + _TIE)].sum()))


def _log_choose(n: int, k: IntArray) -> FloatArray:
    return np.asarray(gammaln(n + 1.0) - gammaln(k + 1.0) - gammaln(n - k + 1.0))


def benjamini_hochberg(p_values: FloatArray, rate: float = 0.05) -> BoolArray:
    """Which of many tests are significant at a false-discovery rate.

    Among a thousand squares, fifty fall below 0.05 by chance alone; this keeps the
    expected share of such ones among those that are named below ``rate``.

    Parameters
    ----------
    p_values : array, shape (n,)
    rate : float

    Returns
    -------
    bool array, shape (n,)

    Examples
    --------
    >>> benjamini_hochberg(np.array([0.001, 0.04, 0.2, 0.02])).tolist()
    [True, False, False, True]
    """
    count = len(p_values)
    order = np.argsort(p_values, kind="stable")
    below = p_values[order] <= rate * np.arange(1, count + 1) / max(count, 1)
    last = int(np.flatnonzero(below)[-1]) + 1 if below.any() else 0
    named = np.zeros(count, bool)
    named[order[:last]] = True
    return named
