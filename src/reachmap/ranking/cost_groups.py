"""Costs by quadrant, in supplied and in ranked order, for the chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from reachmap._typing import FloatArray
from reachmap.ranking.ranked_list import RankedList

QUADRANT_ORDER = ("NW", "NE", "SW", "SE", None)


def cost_groups(
    ranked: Sequence[RankedList],
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Terms of J of each quadrant, or of each list that names none.

    Parameters
    ----------
    ranked : sequence of RankedList

    Returns
    -------
    dict
        From label to the terms in supplied order and in ranked order, shape (n, 3),
        or (n, 4) with likeness; a row of NaN is an unreachable grasp.
    """
    groups = {}
    for one in ranked:
        terms = one.ranking.terms[:, : 4 if one.with_likeness else 3]
        for label, rows in _rows(one, several=len(ranked) > 1).items():
            order = one.ranking.order
            best_first = order[np.isin(order, rows)]
            groups[label] = (terms[rows], terms[best_first])
    return groups


def _rows(one: RankedList, *, several: bool) -> dict[str, list[int]]:
    """Rows of each quadrant; of the whole list if it names none."""
    name = Path(one.grasps.source).stem if several else ""
    quadrants = one.grasps.quadrants
    if not any(quadrants):
        return {name or "all": list(range(len(quadrants)))} if quadrants else {}
    return {
        f"{name} {quadrant or 'other'}".strip(): rows
        for quadrant in QUADRANT_ORDER
        if (rows := [row for row, own in enumerate(quadrants) if own == quadrant])
    }
