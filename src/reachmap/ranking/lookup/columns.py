"""The terms of a cost, one column each, as a question asks for them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import FloatArray
from reachmap.errors import SettingsError
from reachmap.ranking.lookup.settings import MARGINS, RankSettings
from reachmap.ranking.lookup.table import TERMS, GraspTable

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
    """Arrange the terms of J that a question weighs.

    Raises
    ------
    SettingsError
        Margins are asked for and the map has none.
    """
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
