"""Significance of a change: exact tests for shares of frames.

SciPy's statistics are imported where they are used: readers of maps import this, and
a ranking has no time for them.
"""

from __future__ import annotations

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray

Z_95 = 1.959963984540054
"""Quantile of the standard normal distribution that leaves 2.5 % above it."""

# The customary level, which the 95 % intervals have as well.
FALSE_DISCOVERY_RATE = 0.05


def mcnemar_exact(gained: int, lost: int) -> float:
    """Two-sided exact p-value of McNemar's test for paired outcomes.

    Only frames whose outcome changed count; if nothing but chance changed them, each
    is as likely to be gained as lost.

    Examples
    --------
    >>> mcnemar_exact(0, 0), mcnemar_exact(5, 0)
    (1.0, 0.0625)
    """
    from scipy import stats

    changed = gained + lost
    return float(stats.binomtest(gained, changed).pvalue) if changed else 1.0


def paired_interval(gained: int, lost: int, pairs: int) -> tuple[float, float]:
    """Interval at 95 % of the change of a share, from paired outcomes, as fractions.

    Half a pair is added to each of the four outcomes (Agresti and Min 2005), so that
    it has a width also where nothing changed. Holds the change itself.

    Examples
    --------
    >>> low, high = paired_interval(0, 0, 100)
    >>> round(low, 4), round(high, 4)
    (-0.0192, 0.0192)
    """
    total = pairs + 2.0
    a, b = (gained + 0.5) / total, (lost + 0.5) / total
    half = Z_95 * np.sqrt((a + b - (a - b) ** 2) / total)
    change = (gained - lost) / pairs
    low, high = max(a - b - half, -1.0), min(a - b + half, 1.0)
    return float(min(low, change)), float(max(high, change))


def clustered_shares(
    change: FloatArray, cluster: IntArray
) -> tuple[float, float, float]:
    """p-value and 95 % interval of the change of a share whose frames fail together.

    Frames at one point share their obstacles: what blocks one blocks its neighbours,
    so that a thousand frames may be a handful of independent facts. Changes are added
    up within each cluster, and the sums are compared with what their signs alone would
    give if they were random. Neither is ever surer than the test frame by frame.

    Parameters
    ----------
    change : array, shape (n,)
        1 gained, -1 lost, 0 neither.
    cluster : int array, shape (n,)
        What each frame belongs to, from 0.

    Returns
    -------
    p_value, low, high : float
        The interval is a fraction of n, and holds the change itself.

    Examples
    --------
    >>> p, low, high = clustered_shares(np.ones(27), np.zeros(27, int))
    >>> round(p, 2)
    0.32
    """
    from scipy import stats

    gained, lost, n = int((change > 0).sum()), int((change < 0).sum()), len(change)
    p_value = mcnemar_exact(gained, lost)
    low, high = paired_interval(gained, lost, n)
    sums = np.bincount(cluster, weights=change)
    spread = float(np.sqrt((sums**2).sum()))
    if spread > 0.0:
        score = abs(float(sums.sum())) / spread
        p_value = max(p_value, 2.0 * float(stats.norm.sf(score)))
    sizes = np.bincount(cluster)
    mean = float(change.mean())
    half = Z_95 * float(np.sqrt(((sums - mean * sizes) ** 2).sum())) / n
    return p_value, min(low, mean - half), max(high, mean + half)


def paired_means(difference: FloatArray) -> tuple[float, float, float, float]:
    """Mean of paired differences, its 95 % interval, and the p-value of the t-test.

    Examples
    --------
    >>> paired_means(np.zeros(4))
    (0.0, 0.0, 0.0, 1.0)
    """
    mean, n = float(difference.mean()), len(difference)
    if n < 2:
        return mean, float("nan"), float("nan"), float("nan")
    error = float(difference.std(ddof=1)) / np.sqrt(n)
    if error == 0.0:
        return mean, mean, mean, float(mean == 0.0)
    from scipy import stats

    half = float(stats.t.ppf(0.975, n - 1)) * error
    p_value = 2.0 * float(stats.t.sf(abs(mean) / error, n - 1))
    return mean, mean - half, mean + half, p_value


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
    from scipy import stats

    tables = np.stack([hits_a, total_a - hits_a, hits_b, total_b - hits_b], axis=-1)
    # Squares of a map share few tables.
    different, place = np.unique(tables, axis=0, return_inverse=True)
    values = [stats.fisher_exact(row.reshape(2, 2)).pvalue for row in different]
    return np.array(values, float)[place.ravel()]


def benjamini_hochberg(p_values: FloatArray) -> BoolArray:
    """Which of many tests are significant at a false-discovery rate of 5 %.

    Among a thousand squares, fifty fall below 0.05 by chance alone; this keeps the
    expected share of such ones among those that are named below 5 %.

    Parameters
    ----------
    p_values : array, shape (n,)

    Returns
    -------
    bool array, shape (n,)

    Examples
    --------
    >>> benjamini_hochberg(np.array([0.001, 0.04, 0.2, 0.02])).tolist()
    [True, False, False, True]
    """
    from scipy import stats

    if not len(p_values):
        return np.zeros(0, bool)
    return np.asarray(stats.false_discovery_control(p_values) <= FALSE_DISCOVERY_RATE)
