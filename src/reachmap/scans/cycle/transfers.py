"""Transfers of the part: from the ends of all lifts to the drop-offs, one roadmap each.

All lifts end above the bin and there are few drop-offs, so paths are sought the other
way round: from one configuration of a drop-off to the ends of all lifts at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.planning.routes import RouteNetwork
from reachmap.runtime.progress import Progress
from reachmap.scans.cycle.connecting import connect_from, path_over, quickest
from reachmap.scans.cycle.places import Places
from reachmap.scans.cycle.scenes import CycleScenes
from reachmap.scans.routes import Routes, pace_of

# Roadmaps of one drop-off: others begin at other configurations of it, and look for
# what the first did not reach.
_MOST_HUBS = 3
# Places that a straight motion is tried to, and drop-offs that are compared.
_STRAIGHT_TRIES, _COMPARED = 4, 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hub:
    """A configuration before a drop-off, and the way from it to lifts.

    Attributes
    ----------
    place : int
        Row of :class:`Places`.
    row : int array, shape (goals,)
        Of each goal of the survey among the lifts that were connected, -1 for none.
    routes : Routes
    """

    place: int
    row: IntArray
    routes: Routes

    def payload(self) -> dict[str, Any]:
        """Its JSON payload for the journal."""
        routes = self.routes.payload()
        return {"place": self.place, "row": self.row, "routes": routes}

    @classmethod
    def from_payload(cls, payload: Mapping[str, Any]) -> Hub:
        """Undo :meth:`payload`."""
        routes = Routes.from_payload(payload["routes"])
        return cls(place=int(payload["place"]), row=payload["row"], routes=routes)


def find_hubs(
    scenes: CycleScenes,
    places: Places,
    goals: IntArray,
    frame: IntArray,
    lifted: FloatArray,
    count: int,
    progress: Progress,
) -> list[Hub]:
    """Connect each drop-off to the ends of the lifts.

    Parameters
    ----------
    scenes : CycleScenes
    places : Places
    goals, frame : int array, shape (n,)
        Goals that have a lift, and the test grasp, or group of them, of each.
    lifted : array, shape (n, dof)
        Ends of their lifts.
    count : int
        Goals in all.
    progress : Progress
    """
    hubs = []
    for drop_off in np.unique(places.drop_off):
        open_ = np.arange(len(goals))
        for place in places.of(int(drop_off))[:_MOST_HUBS]:
            if not len(open_):
                break
            start = places.place[int(place)][0]
            Q = lifted[open_]
            routes = connect_from(scenes.carried, start, Q, frame[open_], progress)
            row = np.full(count, -1, np.int64)
            row[goals[open_]] = np.arange(len(open_))
            hubs.append(Hub(place=int(place), row=row, routes=routes))
            reached = frame[open_][np.isfinite(routes.length_rad)]
            open_ = open_[~np.isin(frame[open_], reached)]
    return hubs


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Transfer:
    """A verified path with the part.

    Attributes
    ----------
    path : array, shape (n, dof)
    place : int
        Row of :class:`Places` that it ends before.
    time_s : float
        Its own.
    total_s : float
        With all that follows.
    """

    path: FloatArray
    place: int
    time_s: float
    total_s: float


class Transfers:
    """Finds the quickest transfers.

    Parameters
    ----------
    scenes : CycleScenes
    places : Places
    hubs : sequence of Hub
    """

    def __init__(
        self, scenes: CycleScenes, places: Places, hubs: Sequence[Hub]
    ) -> None:
        self._scenes, self._scene = scenes, scenes.carried
        self._places, self._hubs = places, hubs
        self._before = places.place.first
        self._rest_s = places.time_s.sum(axis=1)

    def least_s(self, q: FloatArray) -> float:
        """Lower bound of the time of a transfer from q and all that follows."""
        return float(self._bounds_s(q).min())

    def _bounds_s(self, q: FloatArray) -> FloatArray:
        return np.asarray(self._scenes.least_times_s(q, self._before) + self._rest_s)

    def of(self, goal: int, q: FloatArray, seed: int) -> Transfer | None:
        """Quickest transfer from the end of the lift of a goal, None without one."""
        bounds = self._bounds_s(q)
        order = np.argsort(bounds, kind="stable")
        best = self._straight(q, order[:_STRAIGHT_TRIES])
        if best is not None and best.place == order[0]:
            return best
        compared = 0
        for hub in sorted(self._hubs, key=lambda hub: self._bound_s(hub, bounds)):
            if best is not None and (
                self._bound_s(hub, bounds) >= best.total_s or compared == _COMPARED
            ):
                break
            made = self._over(hub, goal, q, seed)
            compared += made is not None
            if made is not None and (best is None or made.total_s < best.total_s):
                best = made
        return best

    def _bound_s(self, hub: Hub, bounds: FloatArray) -> float:
        rows = self._places.of(int(self._places.drop_off[hub.place]))
        return float(bounds[rows].min())

    def _straight(self, q: FloatArray, places: IntArray) -> Transfer | None:
        for place in places:
            if self._scene.motions.is_verified(q, self._before[place]):
                return self._transfer(np.array([q, self._before[place]]), int(place))
        return None

    def _over(self, hub: Hub, goal: int, q: FloatArray, seed: int) -> Transfer | None:
        """Over the roadmap of a drop-off, to whichever of its places is quickest."""
        row = int(hub.row[goal])
        path = None if row < 0 else path_over(self._scene, hub.routes, row, q, seed)
        if path is None:
            return None
        path = path[::-1]
        found = [self._transfer(path, hub.place)]
        rows = self._places.of(int(self._places.drop_off[hub.place]))
        others = rows[rows != hub.place]
        if len(others) and len(path) > 1:
            spec, motions = self._scene.loaded.cell.roadmap, self._scene.motions
            ways = RouteNetwork.of([path], pace_of(self._scene)).ways_to(
                self._before[others], motions, spec
            )
            for way in ways:
                ends = np.abs(self._before[others] - way[-1]).max(axis=1)
                short = quickest(self._scene, [way], seed)
                assert short is not None
                found.append(self._transfer(short, int(others[np.argmin(ends)])))
        return min(found, key=lambda transfer: transfer.total_s)

    def _transfer(self, path: FloatArray, place: int) -> Transfer:
        time_s = self._scene.time_law.path_time_s(path)
        return Transfer(
            path=path,
            place=place,
            time_s=time_s,
            total_s=time_s + float(self._rest_s[place]),
        )
