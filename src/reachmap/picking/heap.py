"""A heap of parts in a bin, dropped one by one.

No dynamics: a part comes to rest on one of its sides, tilted as the surface under it
does, touches it and does not sink in. That gives heaps their tilts, holes and parts
that cover each other, and needs no more than a map of heights.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reachmap._typing import BoolArray, FloatArray, IntArray
from reachmap.cell.model.bin_parts import inner_at
from reachmap.cell.model.bodies import BinSpec

# Side of a cell of the height map, as a share of the part's shortest side, within
# bounds that keep it fine enough for small parts and small enough for large bins.
CELL_SHARE, FINEST_M, COARSEST_M = 0.25, 0.002, 0.01
# A part slides down a steeper slope; friction of plastic and metal allows 0.5.
STEEPEST = 0.5
TRIES = 20
# A part rolls to the lowest of this many places.
PLACES = 6
# A part is covered by another that hides its middle, or this share of its top.
COVERED_SHARE = 0.25


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Heap:
    """Parts in a bin, in the order in which they were dropped. In the bin frame.

    Attributes
    ----------
    position : array, shape (n, 3)
        Middle of the top of each [m].
    normal : array, shape (n, 3)
        Unit, out of the top.
    above : tuple of int arrays
        Parts that cover each.
    outline : array, shape (n, 4, 2)
        Corners of each seen from above [m].
    """

    position: FloatArray
    normal: FloatArray
    above: tuple[IntArray, ...]
    outline: FloatArray

    def __len__(self) -> int:
        return len(self.position)


def drop_heap(
    spec: BinSpec, part: tuple[float, float, float], fill: float, seed: int
) -> Heap:
    """Fill a bin with parts.

    Parameters
    ----------
    spec : BinSpec
    part : (float, float, float)
        Sides of a box around the part [m].
    fill : float
        Share of the depth that parts may reach up to, on average.
    seed : int

    Returns
    -------
    Heap
        Empty where not a single part fits.
    """
    surface = _Surface(spec, min(part))
    rng = np.random.default_rng(seed)
    level = fill * spec.inner[2]
    laid: list[_Rest] = []
    above: list[list[int]] = []
    missed = 0
    while missed < TRIES and surface.mean_m < level:
        found = surface.lay(len(laid), _resting(part, rng), rng)
        if found is None:
            missed += 1
            continue
        missed = 0
        rest, covered = found
        for below in covered:
            above[below].append(len(laid))
        laid.append(rest)
        above.append([])
    return Heap(
        position=np.array([rest.position for rest in laid]).reshape(-1, 3),
        normal=np.array([rest.normal for rest in laid]).reshape(-1, 3),
        above=tuple(np.array(parts, np.int64) for parts in above),
        outline=np.array([rest.outline() for rest in laid]).reshape(-1, 4, 2),
    )


def _resting(
    part: tuple[float, float, float], rng: np.random.Generator
) -> tuple[float, float, float]:
    """Sides of a resting part, weighted by area over height: flat ones are likelier."""
    a, b, c = part
    lying = np.array([(a, b, c), (b, c, a), (a, c, b)])
    weight = lying[:, 0] * lying[:, 1] / lying[:, 2]
    x, y, z = lying[rng.choice(3, p=weight / weight.sum())].tolist()
    return x, y, z


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rest:
    """A possible resting pose of a part, and the height-map cells under it."""

    position: FloatArray
    normal: FloatArray
    under: BoolArray
    top: FloatArray
    along: FloatArray
    half: FloatArray

    def outline(self) -> FloatArray:
        """Corners seen from above, shape (4, 2) [m]."""
        axes = np.array([self.along, (-self.along[1], self.along[0])])
        unit = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        return np.asarray(self.position[:2] + unit * self.half @ axes)

    def hides(self, point: FloatArray) -> bool:
        """Whether a point lies below the part."""
        offset, u = point[:2] - self.position[:2], self.along
        across = offset[1] * u[0] - offset[0] * u[1]
        return bool(abs(offset @ u) <= self.half[0] and abs(across) <= self.half[1])


def _height_of(rest: _Rest) -> float:
    return float(rest.position[2])


class _Surface:
    """Heights over the bottom of a bin, and the part that is on top at each."""

    def __init__(self, spec: BinSpec, shortest_m: float) -> None:
        self._spec = spec
        size = float(np.clip(CELL_SHARE * shortest_m, FINEST_M, COARSEST_M))
        half = np.array(spec.inner[:2]) / 2.0
        # Cells fill the inner bottom; a bin that widens is filled straight up.
        count = np.maximum(np.rint(2.0 * half / size).astype(int), 1)
        self._x, self._y = (
            (np.arange(n) + 0.5) / n * 2.0 * h - h
            for n, h in zip(count, half, strict=True)
        )
        self._height = np.zeros((len(self._y), len(self._x)))
        self._owner = np.full(self._height.shape, -1)
        self._rest_of: dict[int, _Rest] = {}

    @property
    def mean_m(self) -> float:
        """Mean height above the bottom, over all cells of the height map [m]."""
        return float(self._height.mean())

    def lay(
        self,
        number: int,
        sides: tuple[float, float, float],
        rng: np.random.Generator,
    ) -> tuple[_Rest, list[int]] | None:
        """Drop a part into the lowest of some random poses; None if there is no room.

        With the parts on top until now that it covers.
        """
        found = [self._rest(sides, rng) for _ in range(PLACES)]
        best = min((r for r in found if r is not None), key=_height_of, default=None)
        if best is None:
            return None
        covered = self._covered(best)
        self._height[best.under] = best.top
        self._owner[best.under] = number
        self._rest_of[number] = best
        return best, covered

    def _rest(
        self, sides: tuple[float, float, float], rng: np.random.Generator
    ) -> _Rest | None:
        """How a part comes to rest at a random place; None where it does not fit."""
        yaw = float(rng.uniform(0.0, 2.0 * np.pi))
        u = np.array([np.cos(yaw), np.sin(yaw)])
        v = np.array([-u[1], u[0]])
        half = np.array(sides[:2]) / 2.0
        reach = np.abs(u) * half[0] + np.abs(v) * half[1]
        room = np.array(inner_at(self._spec, 0.0)) - reach
        middle = rng.uniform(-1.0, 1.0, 2) * room
        if (room < 0).any():
            return None
        dx, dy = self._x - middle[0], self._y[:, None] - middle[1]
        along, across = dx * u[0] + dy * u[1], dx * v[0] + dy * v[1]
        under: BoolArray = (np.abs(along) <= half[0]) & (np.abs(across) <= half[1])
        if not under.any():
            return None
        slopes = self._slopes(along[under], across[under], self._height[under], half)
        plane = slopes[0] * along[under] + slopes[1] * across[under]
        rest = float((self._height[under] - plane).max())
        normal = np.append(-(slopes[0] * u + slopes[1] * v), 1.0)
        normal /= np.linalg.norm(normal)
        # Along the vertical a leaning slab is thicker.
        top = rest + sides[2] / normal[2]
        if float((plane + top).max()) > self._spec.inner[2]:
            return None
        return _Rest(
            position=np.append(middle, top),
            normal=normal,
            under=under,
            top=plane + top,
            along=u,
            half=half,
        )

    def _slopes(
        self, along: FloatArray, across: FloatArray, z: FloatArray, half: FloatArray
    ) -> tuple[float, float]:
        """Slopes between the highest points on either side of a part."""
        found = []
        for place, reach in ((along, half[0]), (across, half[1])):
            low, high = place < 0, place >= 0
            if not low.any() or not high.any():
                found.append(0.0)
                continue
            a, b = (
                int(np.argmax(np.where(low, z, -1.0))),
                int(np.argmax(np.where(high, z, -1.0))),
            )
            run = max(float(place[b] - place[a]), float(reach))
            found.append(float(np.clip((z[b] - z[a]) / run, -STEEPEST, STEEPEST)))
        return found[0], found[1]

    def _covered(self, rest: _Rest) -> list[int]:
        """Parts that a new one covers: much of what is seen of them, or the middle."""
        owners, cells = np.unique(self._owner[rest.under], return_counts=True)
        hidden = dict(zip(owners.tolist(), cells.tolist(), strict=True))
        return [
            number
            for number, other in self._rest_of.items()
            if hidden.get(number, 0) >= COVERED_SHARE * len(other.top)
            or rest.hides(other.position)
        ]
