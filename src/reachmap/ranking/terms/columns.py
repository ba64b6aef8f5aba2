"""The requested terms of a cost, one column each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.errors import SettingsError
from reachmap.ranking.lookup.settings import MARGINS, RankSettings
from reachmap.ranking.lookup.table import TERMS, GraspTable
from reachmap.ranking.terms.seconds import PLANNING, CycleSeconds

LIKENESS = "likeness"


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Terms that belong to test grasps.

    Attributes
    ----------
    names : tuple of str, length k
    weights : array, shape (k,)
    values : array, shape (points, orientations, k)
        Before weighting; NaN where unreachable.
    worst : array, shape (k,)
        Greatest of each, which an unreachable neighbour counts with.
    """

    names: tuple[str, ...]
    weights: FloatArray
    values: FloatArray
    worst: FloatArray

    def costs(self) -> FloatArray:
        """Weighted sum for every test grasp, shape (points, orientations).

        Infinite where unreachable.
        """
        cost = self.values @ self.weights
        return np.where(np.isnan(cost), np.inf, cost)


def columns_of(table: GraspTable, settings: RankSettings) -> Columns:
    """Arrange the requested terms.

    Raises
    ------
    SettingsError
        Margins or seconds are asked for and the map has none.
    """
    if settings.cost == "cycle":
        return _seconds(table, cycle_of(table))
    columns = Columns(
        names=TERMS,
        weights=np.asarray(settings.weights, float),
        values=table.normalised,
        worst=table.maxima / table.scale,
    )
    asked = [name for name in MARGINS if settings.margins.get(name)]
    if not asked:
        return columns
    if table.margins is None:
        raise SettingsError(
            f"{', '.join(asked)}: the map has no margins, as those of format 1.0; "
            "scan the bin again"
        )
    values = table.margins[..., [MARGINS.index(name) for name in asked]]
    return Columns(
        names=(*TERMS, *asked),
        weights=np.append(columns.weights, [settings.margins[k] for k in asked]),
        values=np.concatenate([columns.values, values], axis=-1),
        worst=np.append(
            columns.worst,
            values.max(axis=(0, 1), where=table.reachable[..., None], initial=0.0),
        ),
    )


def cycle_of(table: GraspTable) -> CycleSeconds:
    """Seconds of whole picks.

    Raises
    ------
    SettingsError
        The map has none.
    """
    if table.cycle is None:
        raise SettingsError(
            "cost cycle: the map has ways to the grasps only and no whole cycles; give "
            "the cell part, lift and drop_off and scan the bin again, or rank by cost "
            "paper"
        )
    return table.cycle


def _seconds(table: GraspTable, cycle: CycleSeconds) -> Columns:
    planning = np.where(cycle.whole, table.means[..., TERMS.index("planning_time")], 0)
    values = np.concatenate([cycle.values, planning[..., None]], axis=-1)
    return Columns(
        names=(*cycle.names, PLANNING),
        weights=np.ones(values.shape[-1]),
        values=values,
        worst=np.nan_to_num(values).max(axis=(0, 1)),
    )
