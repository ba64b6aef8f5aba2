"""Exact scores on all cores, with one set of workers for the whole search."""

from __future__ import annotations

import dataclasses
import json
import secrets
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.scene import Scene
from reachmap.errors import EngineError
from reachmap.placement.mapped.exact import ALWAYS, NEVER, PlacedScene, Pose, PoseScore
from reachmap.placement.mapped.imaging import UNSEEN, imaging_configurations
from reachmap.placement.mapped.sample import COARSE, Grid, Sample, sample_of
from reachmap.runtime.encoding import json_from_value, value_from_json
from reachmap.runtime.progress import Progress
from reachmap.runtime.results import last_line
from reachmap.runtime.work import one_frame
from reachmap.runtime.workers.crew import Crew
from reachmap.runtime.workers.executors import open_lanes
from reachmap.runtime.workers.tasks import Job, Parcel, package_versions

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """What became of one pose with the bin in the scene.

    Attributes
    ----------
    bound : float
        No score can be higher [percent].
    score : PoseScore or None
        None if the bound is not above what was asked for, or for a reason.
    reason : str
        Why there is no scan configuration to start from, or "".
    """

    bound: float
    score: PoseScore | None
    reason: str = ""


class Evaluator:
    """Scores poses exactly; made by :func:`open_evaluator`.

    Parameters
    ----------
    crew : Crew
    progress : Progress

    Attributes
    ----------
    cpu_s : float
        What the workers have spent so far.
    mapped : int
        Poses looked at so far with the bin in the scene.
    """

    def __init__(self, crew: Crew, progress: Progress) -> None:
        self._crew, self._progress = crew, progress
        self._known: dict[tuple[float, ...], Evaluation] = {}
        self._expects = False
        self.cpu_s = 0.0
        self.mapped = 0

    def expect(self, poses: int) -> None:
        """Say how many more poses will be looked at, at most."""
        if self._expects:
            self._progress.expect(self.mapped + poses)
        else:
            self._progress.begin(poses)
            self._expects = True

    def evaluate(
        self,
        poses: Sequence[Pose],
        q: FloatArray | None,
        *,
        above: float | Sequence[float] = ALWAYS,
        enough: float = NEVER,
        grid: Grid = COARSE,
    ) -> list[Evaluation]:
        """Score poses, each from a scan configuration.

        Parameters
        ----------
        poses : sequence of (x, y, z [m], yaw [rad])
        q : array, shape (dof,) or (poses, dof), or None
            Scan configuration of all, or of each [rad]. None where it is chosen
            later: the cell's own or, where the bin is in its way, one that images
            the bin.
        above : float or sequence of float
            A pose whose bound is not above this need not be scored [percent]; of all,
            or of each.
        enough : float
            A score from which on no more is looked for [percent].
        grid : (int, int, int)
            See :func:`reachmap.placement.mapped.sample.sample_of`.
        """
        start = np.zeros(0) if q is None else q
        starts = np.broadcast_to(start, (len(poses), start.shape[-1]))
        keys = [
            (*grid, enough, *pose, *start.tolist())
            for pose, start in zip(poses, starts, strict=True)
        ]
        least = np.broadcast_to(above, len(poses)).tolist()
        units = {
            unit_of_numbers([*key, least_of_key]): key
            for key, least_of_key in dict(zip(keys, least, strict=True)).items()
            if self._is_open(key, least_of_key)
        }
        with closing(self._crew.replies(units)) as replies:
            for reply in replies:
                if reply is None:
                    self._progress.tick()
                    continue
                content = json.loads(reply.payload)
                if reply.failed:
                    raise EngineError(f"a bin pose failed: {last_line(content)}")
                self._known[units[reply.unit]] = _evaluation(value_from_json(content))
                self.cpu_s += reply.measure.cpu_s
                self.mapped += 1
                self._progress.add(1, 1)
        return [self._known[key] for key in keys]

    def _is_open(self, key: tuple[float, ...], above: float) -> bool:
        """Whether a pose must be looked at, or looked at again."""
        known = self._known.get(key)
        if known is None:
            return True
        return known.score is None and not known.reason and known.bound > above


@contextmanager
def open_evaluator(
    loaded: LoadedCell,
    is_open: BoolArray,
    *,
    workers: int,
    executor: str,
    progress: Progress,
) -> Iterator[Evaluator]:
    """Start workers that score poses, and stop them afterwards.

    Parameters
    ----------
    loaded : LoadedCell
    is_open : bool array, shape (layers, y, x, orientations)
        See :func:`reachmap.placement.mapped.sample.open_frames`.
    workers : int
    executor : str
    progress : Progress
    """
    job = Job(
        function=evaluate_unit,
        prepare=Prepared,
        encode=json_from_value,
        tally=one_frame,
        context=(loaded, is_open),
        packages=package_versions(),
    )
    parcel = Parcel(key=secrets.token_hex(16), job=job)
    with open_lanes(executor, workers, parcel) as lanes, Crew(lanes) as crew:
        yield Evaluator(crew, progress)
        progress.end()


class Prepared:
    """A worker's scene, with the bin where it was last wanted.

    Parameters
    ----------
    context : (LoadedCell, bool array)
        See :func:`open_evaluator`.
    """

    def __init__(self, context: tuple[LoadedCell, BoolArray]) -> None:
        loaded, self._is_open = context
        self._scene = Scene.build(loaded, with_bin=True, bin_moves=True)
        self._samples: dict[Grid, Sample] = {}
        self._at: tuple[Grid, Pose] | None = None
        self._placed: PlacedScene | None = None

    def scene_at(self, pose: Pose, grid: Grid) -> PlacedScene:
        """Scene with the bin at a pose."""
        if self._placed is None or self._at != (grid, pose):
            if grid not in self._samples:
                cell = self._scene.loaded.cell
                self._samples[grid] = sample_of(cell, grid, self._is_open)
            self._placed = PlacedScene(self._scene, pose, self._samples[grid])
            self._at = (grid, pose)
        return self._placed


def evaluate_unit(prepared: Prepared, unit: int) -> dict[str, Any]:
    """Score one pose; the unit's number says which, see :func:`unit_of_numbers`."""
    along, across, part, enough, x, y, z, yaw, *rest = numbers_of_unit(unit)
    placed = prepared.scene_at((x, y, z, yaw), (int(along), int(across), int(part)))
    q, reason = start_of(placed, np.array(rest[:-1]) if rest[:-1] else None)
    if q is None:
        return {"bound": 0.0, "reason": reason, "score": None}
    bound, score = placed.score_from(q, above=rest[-1], enough=enough)
    return {
        "bound": bound,
        "reason": "",
        "score": None if score is None else dataclasses.asdict(score),
    }


def start_of(
    placed: PlacedScene, q: FloatArray | None
) -> tuple[FloatArray | None, str]:
    """Scan configuration to start from, or None and why there is none.

    Parameters
    ----------
    placed : PlacedScene
    q : array, shape (dof,), or None
        See :meth:`Evaluator.evaluate`.
    """
    checker = placed.scene.checker
    wanted = placed.scene.scan_configuration if q is None else q
    pair = checker.blocking_pair(wanted)
    if pair < 0:
        return wanted, ""
    if q is not None:
        return None, f"{checker.body_pairs[pair]} at the scan configuration"
    image = next(imaging_configurations(placed.scene, placed.Q, placed.frame), None)
    return image, UNSEEN if image is None else ""


def unit_of_numbers(numbers: Sequence[float]) -> int:
    """Number of a unit that carries float64 numbers, bit for bit.

    Units are numbered before workers start, and poses come up while they work.
    """
    return int.from_bytes(b"\x01" + np.asarray(numbers, ">f8").tobytes(), "big")


def numbers_of_unit(unit: int) -> list[float]:
    """Undo :func:`unit_of_numbers`."""
    raw = unit.to_bytes((unit.bit_length() + 7) // 8, "big")[1:]
    return [float(v) for v in np.frombuffer(raw, ">f8")]


def _evaluation(content: dict[str, Any]) -> Evaluation:
    score = content["score"]
    return Evaluation(
        bound=content["bound"],
        score=None if score is None else PoseScore(**score),
        reason=content["reason"],
    )
