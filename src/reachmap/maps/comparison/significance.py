"""Is a change more than chance: exact tests for shares of frames."""

from __future__ import annotations

import numpy as np
from scipy import stats

from reachmap._typing import BoolArray, FloatArray, IntArray


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
    return float(stats.binomtest(gained, changed).pvalue) if changed else 1.0


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
    tables = np.stack([hits_a, total_a - hits_a, hits_b, total_b - hits_b], axis=-1)
    # Squares of a map share few tables.
    different, place = np.unique(tables, axis=0, return_inverse=True)
    values = [stats.fisher_exact(row.reshape(2, 2)).pvalue for row in different]
    return np.array(values, float)[place.ravel()]


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
    if not len(p_values):
        return np.zeros(0, bool)
    return np.asarray(stats.false_discovery_control(p_values) <= rate)
