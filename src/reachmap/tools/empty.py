"""``empty``: a bin map and a part go in, what stays in the bin comes out."""

from __future__ import annotations

import dataclasses
import json
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.loading import stored_cell
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.shapes import sides
from reachmap.errors import SettingsError
from reachmap.maps import BinMap, check_outputs, publish, read_bin_map
from reachmap.picking.emptying import Emptied, Fate, Order, empty_heap
from reachmap.picking.heap import Heap, drop_heap
from reachmap.picking.summary import HeapSummary, summarise_heap
from reachmap.ranking.lookup.order import OUTSIDE_MAP, UNLIKE_MAP
from reachmap.ranking.lookup.ranker import Ranker

logger = logging.getLogger(__name__)

FILL, HEAPS, MAX_HEAPS = 0.9, 3, 1000
MAX_PARTS = 20_000
ORDERS = ("highest", "rank")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SimulatedHeap:
    """A heap and how it was emptied.

    Attributes
    ----------
    heap : Heap
    cost : array, shape (n,)
        J of picking each part; infinite where the map does not reach it.
    emptied : Emptied
    summary : HeapSummary
    """

    heap: Heap
    cost: FloatArray
    emptied: Emptied
    summary: HeapSummary


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EmptyAnswer:
    """Heaps picked to the end.

    Attributes
    ----------
    part : (float, float, float)
        Sides of a box around the part [m].
    fill : float
        Share of the depth that the heaps reach up to.
    order : str
    heaps : tuple of SimulatedHeap
    """

    part: tuple[float, float, float]
    fill: float
    order: str
    heaps: tuple[SimulatedHeap, ...]

    def total(self, name: str) -> int:
        """Sum of a count over all heaps, ``parts`` or ``picked`` for one."""
        return sum(int(getattr(one.summary, name)) for one in self.heaps)

    @property
    def left_percent(self) -> float:
        """Parts of all heaps that stay."""
        parts = self.total("parts")
        return 100.0 * (parts - self.total("picked")) / max(parts, 1)

    def facts(self, *, with_parts: bool = False) -> dict[str, Any]:
        """As JSON values.

        Parameters
        ----------
        with_parts : bool
            Also every part: position and normal in the bin frame, fate and turn.
        """
        heaps = []
        for one in self.heaps:
            entry: dict[str, Any] = dataclasses.asdict(one.summary)
            if with_parts:
                entry["each"] = _parts(one)
            heaps.append(entry)
        return {
            "part_m": list(self.part),
            "fill": self.fill,
            "order": self.order,
            "parts": self.total("parts"),
            "picked": self.total("picked"),
            "unreachable": self.total("unreachable"),
            "covered": self.total("covered"),
            "outside_map": self.total("outside_map"),
            "left_percent": self.left_percent,
            "heaps": heaps,
        }


def _parts(one: SimulatedHeap) -> list[dict[str, Any]]:
    return [
        {
            "position": one.heap.position[k].round(6).tolist(),
            "normal": one.heap.normal[k].round(6).tolist(),
            "fate": Fate(int(one.emptied.fate[k])).name.lower(),
            "turn": int(one.emptied.turn[k]) if one.emptied.turn[k] >= 0 else None,
            "cost": float(one.cost[k]) if np.isfinite(one.cost[k]) else None,
        }
        for k in range(len(one.heap))
    ]


def empty(
    map_path: Path,
    *,
    part: tuple[float, float, float] | None = None,
    fill: float = FILL,
    heaps: int = HEAPS,
    order: Order = "highest",
    seed: int | None = None,
    output: Path | None = None,
    overwrite: bool = False,
) -> EmptyAnswer:
    """Fill a bin with parts at random and pick them to the end, with the map alone.

    Parameters
    ----------
    map_path : Path
        A bin map.
    part : (float, float, float), optional
        Sides of a box around the part [m]; default: of the part that the cell names.
    fill : float
        Share of the depth that parts reach up to, on average.
    heaps : int
        Heaps, with seeds one after the other.
    order : {"highest", "rank"}
        Of what lies free, the highest part first or the one that costs least.
    seed : int, optional
        Of the first heap; default: the map's.
    output : Path, optional
        A JSON file with every part.
    overwrite : bool

    Raises
    ------
    SettingsError
        The part does not fit, or there is none.
    MapFileError, OutputError
    """
    if order not in ORDERS:
        raise SettingsError(f"--order {order!r}: expected {' or '.join(ORDERS)}")
    if not 0 < fill <= 1:
        raise SettingsError(f"--fill must be above 0 and at most 1 (got {fill:g})")
    if not 1 <= heaps <= MAX_HEAPS:
        raise SettingsError(f"--heaps must be 1 to {MAX_HEAPS} (got {heaps})")
    check_outputs([output], overwrite=overwrite, inputs=[map_path])
    bin_map = read_bin_map(map_path)
    cell = stored_cell(bin_map.provenance.cell_resolved_json, source=str(map_path)).cell
    part = _part_of(cell, map_path) if part is None else part
    _check_part(cell, part, fill)
    _warn(cell, bin_map, map_path)
    first = bin_map.stamp.seed if seed is None else seed
    ranker = Ranker(bin_map)
    found = tuple(
        _simulated(ranker, bin_map, cell, part, fill, order, first + k)
        for k in range(heaps)
    )
    if not any(len(one.heap) for one in found):
        raise SettingsError(
            f"--part: not a single one fits at a fill of {fill:g} (the bin is "
            f"{_mm(cell.bin.inner)} mm inside)"
        )
    answer = EmptyAnswer(part=part, fill=fill, order=order, heaps=found)
    if output is not None:
        facts = {"map": bin_map.stamp.content_sha256} | answer.facts(with_parts=True)
        text = json.dumps(facts, indent=1, allow_nan=False)
        publish(output, [text.encode("ascii"), b"\n"], overwrite=overwrite)
    return answer


def part_costs(
    ranker: Ranker, bin_map: BinMap, heap: Heap
) -> tuple[FloatArray, BoolArray]:
    """Cost of each part of a heap, (n,), and whether the map says nothing of it.

    Parts are grasped at the middle of their top, along its normal, at any roll.
    """
    T = bin_map.bin_pose
    ranking = ranker.rank(
        heap.position @ T[:3, :3].T + T[:3, 3], -heap.normal @ T[:3, :3].T
    )
    return ranking.cost, np.isin(ranking.status, [OUTSIDE_MAP, UNLIKE_MAP])


def _simulated(
    ranker: Ranker,
    bin_map: BinMap,
    cell: Cell,
    part: tuple[float, float, float],
    fill: float,
    order: Order,
    seed: int,
) -> SimulatedHeap:
    heap = drop_heap(cell.bin, part, fill, seed)
    cost, outside = part_costs(ranker, bin_map, heap)
    emptied = empty_heap(heap, cost, order)
    return SimulatedHeap(
        heap=heap,
        cost=cost,
        emptied=emptied,
        summary=summarise_heap(bin_map, heap, emptied, outside, seed),
    )


def _part_of(cell: Cell, map_path: Path) -> tuple[float, float, float]:
    """Box around the part that the cell names."""
    named = cell.held()
    if named is None:
        raise SettingsError(
            f"{map_path}: its cell has no part; give one, as in --part 60x40x20mm"
        )
    name, spec = named
    if spec.shape.mesh is not None:
        raise SettingsError(
            f"{map_path}: {name} is a mesh; give the box around it, --part 60x40x20mm"
        )
    x, y, z = sides(spec.shape).tolist()
    return x, y, z


def _check_part(cell: Cell, part: tuple[float, float, float], fill: float) -> None:
    if min(part) <= 0:
        raise SettingsError(f"--part: sides must be positive (got {_mm(part)} mm)")
    volume = np.prod(cell.bin.inner) * fill
    if volume / np.prod(part) > MAX_PARTS:
        raise SettingsError(
            f"--part: more than {MAX_PARTS} of {_mm(part)} mm go into the bin"
        )


def _warn(cell: Cell, bin_map: BinMap, map_path: Path) -> None:
    """Say what the map does not know about heaps."""
    if not cell.bin_scan.is_filled:
        logger.warning(
            "%s: made in an empty bin, where parts below the one that is picked are no "
            "obstacle (bin_scan.fill scans it at levels of filling)",
            map_path,
        )
    elif len(bin_map.layer) == 1:
        logger.warning("%s: has a single level of filling", map_path)


def _mm(lengths_m: tuple[float, ...]) -> str:
    return " x ".join(f"{1e3 * length:g}" for length in lengths_m)
