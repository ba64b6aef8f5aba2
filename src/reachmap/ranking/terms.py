"""Terms of a cost beside the three of J: margins of the path, seconds per pick.

A margin m becomes a cost that falls from 1 where nothing is left to 0 where as much is
left as anywhere: max(0, 1 - m/s), where s is the 95 % quantile of m over the
path-reachable test grasps (or its maximum, as for the other terms). Wind-up w, like
φ3, φ4 and φ5, counts as w/s.

A pick over a test grasp takes the time of its cycle, which is cut into the way to the
grasp, the stages that follow and the waits; to it come the planning effort and what a
failure costs times its probability.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import BoolArray, CodeArray, FloatArray
from reachmap.maps.cycle.seconds import cycle_parts, failing_stage
from reachmap.maps.parts import StageStatus, freeze
from reachmap.maps.records import BinMap
from reachmap.ranking.lookup.settings import MARGINS

if TYPE_CHECKING:
    from collections.abc import Callable

PLANNING, FAILURE = "planning_s", "failure_s"


def margin_values(bin_map: BinMap) -> FloatArray | None:
    """Margins of every test grasp, shape (layer, y, x, orientation, 4).

    In the order of ``MARGINS``: clearance [m], distance to a joint limit [rad], least
    singular value of the Jacobian, wind-up [rad]. NaN where there is no path, and where
    nothing sets a limit; None for a map without margins.
    """
    margins = bin_map.margins
    if margins is None or bin_map.best is None:
        return None
    return np.stack(
        [
            margins.clearance,
            margins.joint_margin,
            margins.smallest_singular_value,
            _wind_up_rad(bin_map),
        ],
        axis=-1,
    )


def margin_terms(
    values: FloatArray,
    reachable: BoolArray,
    scale_of: Callable[[FloatArray, FloatArray], FloatArray],
) -> FloatArray:
    """Normalised terms, 0 for the best; NaN where unreachable.

    Parameters
    ----------
    values : array, shape (..., 4)
        From :func:`margin_values`.
    reachable : bool array, shape (...)
    scale_of : callable
        Scale (4,) of values (k, 4) with given maxima (4,).
    """
    # Where nothing sets a limit, nothing is near: as good as the best there is.
    known = values[reachable]
    best = np.where(np.isnan(known), -np.inf, known).max(axis=0, initial=0.0)
    filled = np.where(np.isnan(values), best, values)
    scale = scale_of(filled[reachable], best)
    terms = filled / scale
    wind_up = MARGINS.index("wind_up")
    left = np.arange(len(MARGINS)) != wind_up
    terms[..., left] = np.maximum(1.0 - terms[..., left], 0.0)
    terms[np.isnan(values)] = 0.0
    return np.where(reachable[..., None], terms, np.nan)


def _wind_up_rad(bin_map: BinMap) -> FloatArray:
    """Furthest that the last joint turns from the scan configuration [rad].

    On the best path to each test grasp and the later stages of its cycle; NaN where
    there is no path.
    """
    paths, best = bin_map.paths, bin_map.best
    assert best is not None
    wound = np.full(best.row.shape, np.nan)
    if not len(paths.row_size):
        return wound
    turned = np.abs(paths.configuration[:, -1] - bin_map.scan_configuration[-1])
    starts = np.concatenate([[0], np.cumsum(paths.row_size)[:-1]])
    furthest = np.maximum.reduceat(turned, starts)
    has_path = best.row >= 0
    wound[has_path] = furthest[best.row[has_path]]
    if paths.stage is not None:
        later = paths.stage > 0
        place = tuple(paths.index[later, :4].T)
        np.fmax.at(wound, place, furthest[later])
    return wound


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CycleSeconds:
    """Duration of picks at test grasps, by stage.

    Attributes
    ----------
    names : tuple of str, length k
        ``to_grasp_s``, each stage with ``_s``, ``waits_s``.
    values : array, shape (points, orientations, k)
        [s]; they add up to the cycle's time. NaN without a whole cycle.
    status : uint8 array, shape (points, orientations)
        :class:`StageStatus` of the first stage that fails; that of the grasp where
        none does or none was tried.
    """

    names: tuple[str, ...]
    values: FloatArray
    status: CodeArray

    def __post_init__(self) -> None:
        freeze(self)

    @property
    def whole(self) -> BoolArray:
        """Where there is a whole cycle, shape (points, orientations)."""
        return np.isfinite(self.values[..., 0])

    def usual_failure_s(self) -> float:
        """Default cost of a failure: the median whole cycle of the map [s]."""
        if not self.whole.any():
            return 0.0
        return float(np.median(self.values[self.whole].sum(axis=-1)))


def cycle_seconds(bin_map: BinMap, status: CodeArray) -> CycleSeconds | None:
    """Cut the cycle times of a map into their parts; None where it has none.

    Parameters
    ----------
    bin_map : BinMap
    status : uint8 array, shape (points, orientations)
        Of the grasps themselves.
    """
    if bin_map.cycle is None:
        return None
    names, values = cycle_parts(bin_map)
    stage = failing_stage(bin_map.cycle)
    ended = np.take_along_axis(bin_map.cycle.status, stage[..., None], -1)
    lost = (status == StageStatus.PATH_FOUND) & (stage >= 0).reshape(status.shape)
    return CycleSeconds(
        names=names,
        values=values.reshape(*status.shape, len(names)),
        status=np.where(lost, ended.reshape(status.shape), status),
    )
