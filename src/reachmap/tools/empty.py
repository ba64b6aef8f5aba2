"""``empty``: a bin map and a part go in, what stays in the bin comes out."""

from __future__ import annotations

import dataclasses
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.loading import stored_cell
from reachmap.cell.meshes.reading import MeshError, read_mesh
from reachmap.cell.model.cell import Cell
from reachmap.cell.model.shapes import sides
from reachmap.disk import as_path
from reachmap.errors import SettingsError
from reachmap.geometry import transform_points
from reachmap.maps import BinMap, check_outputs, read_bin_map
from reachmap.maps.bytes.publish import check_picture, publish_json
from reachmap.picking.emptying import (
    Emptied,
    Fate,
    HeapSummary,
    Order,
    empty_heap,
    summarise_heap,
)
from reachmap.picking.heap import Heap, drop_heap
from reachmap.ranking.lookup.costs import OUTSIDE_MAP, UNLIKE_MAP
from reachmap.ranking.lookup.probability import usual_calibration
from reachmap.ranking.lookup.ranker import Ranker

logger = logging.getLogger(__name__)

# Choices: heaps stay below the rim, and three show how much they differ.
FILL, HEAPS, MAX_HEAPS = 0.9, 3, 1000
# A choice that bounds the memory of a heap.
MAX_PARTS = 20_000
# More likely reached than not.
LIKELY = 0.5
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
    map_path: str | Path,
    *,
    part: tuple[float, float, float] | str | Path | None = None,
    fill: float = FILL,
    heaps: int = HEAPS,
    order: Order = "highest",
    seed: int | None = None,
    output: str | Path | None = None,
    picture: str | Path | None = None,
    overwrite: bool = False,
) -> EmptyAnswer:
    """Fill a bin with parts at random and pick them to the end, with the map alone.

    Parameters
    ----------
    map_path : Path
        A bin map.
    part : (float, float, float) or Path, optional
        Sides of a box around the part [m], or its mesh in metres; default: the part
        that the cell names.
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
    picture : Path, optional
        Draw what stays there (.png or .svg).
    overwrite : bool

    Raises
    ------
    SettingsError
        The part does not fit, or there is none.
    MapFileError, OutputError
    """
    map_path, output, picture = Path(map_path), as_path(output), as_path(picture)
    part = Path(part) if isinstance(part, str) else part
    if order not in ORDERS:
        raise SettingsError(f"--order {order!r}: expected {' or '.join(ORDERS)}")
    if not 0 < fill <= 1:
        raise SettingsError(f"--fill must be above 0 and at most 1 (got {fill:g})")
    if not 1 <= heaps <= MAX_HEAPS:
        raise SettingsError(f"--heaps must be 1 to {MAX_HEAPS} (got {heaps})")
    check_picture(picture, "--picture")
    inputs = [map_path, part] if isinstance(part, Path) else [map_path]
    check_outputs([output, picture], overwrite=overwrite, inputs=inputs)
    bin_map = read_bin_map(map_path)
    cell = stored_cell(bin_map.provenance.cell_resolved_json, source=str(map_path)).cell
    box = _box_around(part, cell, map_path)
    _check_part(cell, box, fill)
    first = bin_map.stamp.seed if seed is None else seed
    ranker = Ranker(bin_map, calibration=usual_calibration(map_path, bin_map.stamp))
    found = tuple(
        _simulated(ranker, bin_map, cell, box, fill, order, first + k)
        for k in range(heaps)
    )
    if not any(len(one.heap) for one in found):
        unit = " (meshes are in metres)" if isinstance(part, Path) else ""
        raise SettingsError(
            f"--part: not a single one of {_mm(box)} mm{unit} fits at a fill of "
            f"{fill:g}; the bin is {_mm(cell.bin.inner)} mm inside"
        )
    _warn(cell, bin_map, map_path)
    answer = EmptyAnswer(part=box, fill=fill, order=order, heaps=found)
    if output is not None:
        facts = {"map": bin_map.stamp.content_sha256} | answer.facts(with_parts=True)
        publish_json(output, facts, overwrite=overwrite)
    if picture is not None:
        _draw(picture, bin_map, answer, overwrite=overwrite)
    return answer


def part_costs(
    ranker: Ranker, bin_map: BinMap, heap: Heap
) -> tuple[FloatArray, BoolArray]:
    """Cost of each part of a heap, (n,), and whether the map says nothing of it.

    Parts are grasped at the middle of their top, along its normal, at any roll. Those
    count as reached of which that is more likely than not: between test points, heights
    and directions the nearest test grasp alone is wrong more than twice as often. One
    whose own test grasp is not reached costs as much as the dearest.
    """
    T = bin_map.bin_pose
    ranking = ranker.rank(
        transform_points(T, heap.position), -heap.normal @ T[:3, :3].T
    )
    dearest = float(ranking.cost[ranking.reachable].max(initial=0.0))
    cost = np.where(ranking.reachable, ranking.cost, dearest)
    cost[~(ranking.probability >= LIKELY)] = np.inf
    return cost, np.isin(ranking.status, [OUTSIDE_MAP, UNLIKE_MAP])


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


def _draw(path: Path, bin_map: BinMap, answer: EmptyAnswer, *, overwrite: bool) -> None:
    from reachmap.plots.cell.emptied import draw_emptied
    from reachmap.plots.parts.files import write_picture

    title = f"{answer.left_percent:.1f} % of parts of {_mm(answer.part)} mm remain"
    heaps = [(one.heap, one.emptied) for one in answer.heaps]
    write_picture(
        path,
        draw_emptied(bin_map, heaps, title),
        title="Parts that remain in the bin",
        config_sha256=bin_map.stamp.config_sha256,
        overwrite=overwrite,
    )


def _box_around(
    part: tuple[float, float, float] | Path | None, cell: Cell, map_path: Path
) -> tuple[float, float, float]:
    """Sides of the box around a part, of the cell's where none is given [m]."""
    if isinstance(part, tuple):
        return part
    if part is not None:
        return _box_of_mesh(part)
    named = cell.held()
    if named is None:
        raise SettingsError(
            f"{map_path}: its cell has no part; give one, as in --part 60x40x20mm"
        )
    name, spec = named
    if spec.shape.mesh is not None:
        raise SettingsError(
            f"{map_path}: {name} is a mesh; give its file or the box around it, --part "
            "60x40x20mm"
        )
    x, y, z = sides(spec.shape).tolist()
    return x, y, z


def _box_of_mesh(path: Path) -> tuple[float, float, float]:
    try:
        mesh = read_mesh(path.read_bytes(), path.suffix)
    except OSError as error:
        raise SettingsError(f"--part {path}: {error.strerror}") from None
    except MeshError as error:
        raise SettingsError(f"--part {path}: {error}") from None
    x, y, z = sides(mesh).tolist()
    return x, y, z


def _check_part(cell: Cell, part: tuple[float, float, float], fill: float) -> None:
    if min(part) <= 0:
        raise SettingsError(f"--part: sides must be positive (got {_mm(part)} mm)")
    volume = np.prod(cell.bin.inner) * fill
    if volume / np.prod(part) > MAX_PARTS:
        raise SettingsError(
            f"--part: more than {MAX_PARTS} of {_mm(part)} mm fit into the bin"
        )


def _warn(cell: Cell, bin_map: BinMap, map_path: Path) -> None:
    """Say what the map does not know about heaps."""
    if not cell.bin_scan.is_filled:
        logger.warning(
            "%s: made without levels of filling, so parts below the picked one are not "
            "obstacles (bin_scan.fill scans several levels)",
            map_path,
        )
    elif len(bin_map.layer) == 1:
        logger.warning("%s: has a single level of filling", map_path)


def _mm(lengths_m: tuple[float, ...]) -> str:
    return " x ".join(f"{1e3 * length:g}" for length in lengths_m)
