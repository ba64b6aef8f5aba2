"""Confidence in "no path found", calibrated on cells with known answers."""

from __future__ import annotations

from typing import Final

import numpy as np

from reachmap._typing import CodeArray, FloatArray, IntArray

# State checks by which a component that can be reached was reached, and the share of
# those components: 109 that exploring did not reach, in the cells of
# benchmarks/hard_cells, two seeds each. All were in the end, so 0.99 is the most that
# they say.
_CHECKS: Final = (0, 2_000, 5_000, 10_000, 20_000, 50_000, 80_000)
_SHARE: Final = (0.0, 0.25, 0.55, 0.75, 0.89, 0.95, 0.99)


def confidence_of(checks: IntArray, reached: CodeArray) -> FloatArray:
    """Share of reachable components that are reached with no more checks than these.

    It is the share that a verdict "no path found" of the same effort would not have
    lost where the answer is known. It says that of another cell by analogy only, and
    not how likely the component is to be reachable at all.

    Parameters
    ----------
    checks, reached : int array, shape (components,)
        See :class:`reachmap.maps.parts.Components`.

    Returns
    -------
    array, shape (components,)
        From 0 to 1; 1 for components that are reached.
    """
    share = np.interp(checks, _CHECKS, _SHARE)
    return np.asarray(np.where(reached == 1, 1.0, share))
