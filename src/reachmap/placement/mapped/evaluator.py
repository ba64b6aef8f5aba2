"""Exact scores in parallel, with one worker pool for the whole search."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.memo import Memo, fingerprint, memoized
from reachmap.placement.mapped.exact import (
    ALWAYS,
    BIN_PLACING,
    NEVER,
    PlacedScene,
    Placing,
    Pose,
    PoseScore,
)
from reachmap.placement.mapped.imaging import UNSEEN, imaging_configurations
from reachmap.placement.mapped.sample import COARSE, Grid, Sample, sample_of
from reachmap.runtime.executors import open_pool
from reachmap.runtime.job import Job, Reply
from reachmap.runtime.options import RunOptions
from reachmap.runtime.pool import Pool
from reachmap.runtime.progress import Progress
from reachmap.runtime.run import compute

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """Outcome of one pose with the bin in the scene.

    Attributes
    ----------
    bound : float
        No score can be higher [percent].
    score : PoseScore or None
        None if the bound is not above what was asked for, or for a reason.
    reason : str
        Why there is no scan configuration to start from, or "".
    reachable_share : float
        Share of test frames with an IK solution [percent].
    """

    bound: float
    score: PoseScore | None
    reason: str = ""
    reachable_share: float = np.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A pose to be scored; see :meth:`Evaluator.evaluate`.

    ``q`` is empty where the scan configuration is chosen later.
    """

    grid: Grid
    pose: Pose
    q: tuple[float, ...]
    enough: float


class Evaluator:
    """Scores poses exactly; made by :func:`open_evaluator`.

    Parameters
    ----------
    pool : Pool
    job : Job
    progress : Progress

    Attributes
    ----------
    cpu_s : float
        CPU time and checks of the workers so far.
    mapped : int
        Poses looked at so far with the bin in the scene.
    """

    def __init__(self, pool: Pool, job: Job, progress: Progress) -> None:
        self._pool, self._job, self._progress = pool, job, progress
        self._known: dict[Request, Evaluation] = {}
        self._expects = False
        self.cpu_s = 0.0
        self.mapped = 0

    def expect(self, poses: int) -> None:
        """Announce the maximum number of further poses."""
        if self._expects:
            self._progress.expect(self.mapped + poses)
        else:
            self._progress.begin(poses, even=False)  # at most
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
            or of each. With NEVER there are bounds alone, and no scan configuration
            is looked for.
        enough : float
            A score from which on no more is looked for [percent].
        grid : (int, int, int)
            See :func:`reachmap.placement.mapped.sample.sample_of`.
        """
        start = np.zeros(0) if q is None else q
        starts = np.broadcast_to(start, (len(poses), start.shape[-1]))
        requests = [
            Request(grid=grid, pose=pose, q=tuple(start.tolist()), enough=enough)
            for pose, start in zip(poses, starts, strict=True)
        ]
        least = np.broadcast_to(above, len(poses)).tolist()
        units = [
            (request, least_of_request)
            for request, least_of_request in dict(
                zip(requests, least, strict=True)
            ).items()
            if self._is_open(request, least_of_request)
        ]
        found = compute(
            self._pool, self._job, units, self._progress, measured=self._count
        )
        for (request, _), content in zip(units, found, strict=True):
            self._known[request] = _evaluation(content)
        return [self._known[request] for request in requests]

    def _count(self, reply: Reply) -> None:
        self.cpu_s += reply.measure.cpu_s
        self.mapped += 1

    def _is_open(self, request: Request, above: float) -> bool:
        """Whether a pose still has to be evaluated."""
        known = self._known.get(request)
        if known is None:
            return True
        return known.score is None and not known.reason and known.bound > above


@contextmanager
def open_evaluator(
    loaded: LoadedCell,
    is_open: BoolArray,
    options: RunOptions,
    *,
    progress: Progress,
    placing: Placing = BIN_PLACING,
) -> Iterator[Evaluator]:
    """Start workers that score poses, and stop them afterwards.

    Parameters
    ----------
    loaded : LoadedCell
    is_open : bool array, shape (layers, y, x, orientations)
        See :func:`reachmap.placement.mapped.sample.open_frames`.
    options : RunOptions
    progress : Progress
    placing : Placing
        What is placed.
    """
    context = (loaded, is_open, placing)
    job = Job(function=evaluate_unit, prepare=Prepared, context=context)
    with open_pool(options) as pool:
        try:
            yield Evaluator(pool, job, progress)
        finally:
            progress.end()


class Prepared:
    """A worker's scene, with the bin at its last pose.

    Parameters
    ----------
    context : (LoadedCell, bool array, Placing)
        See :func:`open_evaluator`.
    """

    def __init__(self, context: tuple[LoadedCell, BoolArray, Placing]) -> None:
        self._loaded, self._is_open, self._placing = context
        self._scene = self._placing.scene(self._loaded)
        self._samples: dict[Grid, Sample] = {}
        self._at: tuple[Grid, Pose] | None = None
        self._placed: PlacedScene | None = None

    @cached_property
    def _key(self) -> str:
        """Hash of what a score depends on besides the request and the surroundings.

        "" where the pose is not that of the bin: then what stands around moves.
        """
        if self._placing is not BIN_PLACING:
            return ""
        # The bin's pose is part of the request.
        known = fingerprint(
            self._loaded,
            without=("bin.pose", "bin.frame", "bin.on"),
            surroundings=False,
        )
        seen = hashlib.sha256(self._is_open.tobytes()).hexdigest()
        return f"pose {known} {seen}"

    def memoized(
        self, unit: tuple[Request, float], compute: Callable[[], dict[str, Any]]
    ) -> dict[str, Any]:
        """Score a pose, or reuse the score of a cell in which it is the same."""
        if Memo.current is None or not self._key:
            return compute()
        # Queries for a unit belong to its computation.
        self._placed = self._at = None
        pose = unit[0].pose
        scene = self._placing.at(
            self._scene, self._placing.cell_at(self._scene.loaded, pose)
        )
        return memoized(f"{self._key} {unit}", scene, compute)

    def scene_at(self, pose: Pose, grid: Grid) -> PlacedScene:
        """Scene with what is placed at a pose."""
        if self._placed is None or self._at != (grid, pose):
            if grid not in self._samples:
                cell = self._scene.loaded.cell
                self._samples[grid] = sample_of(cell, grid, self._is_open)
            sample = self._samples[grid]
            self._placed = PlacedScene(self._scene, pose, sample, self._placing)
            self._at = (grid, pose)
        return self._placed


def evaluate_unit(prepared: Prepared, unit: tuple[Request, float]) -> dict[str, Any]:
    """Score one pose, unless its bound is not above a number [percent]."""
    return prepared.memoized(unit, partial(_evaluate, prepared, unit))


def _evaluate(prepared: Prepared, unit: tuple[Request, float]) -> dict[str, Any]:
    request, above = unit
    placed = prepared.scene_at(request.pose, request.grid)
    reachable = placed.reachable_share
    if above >= NEVER:
        bound = placed.bound
        return {"bound": bound, "reason": "", "score": None, "reachable": reachable}
    q, reason = start_of(placed, np.array(request.q) if request.q else None)
    if q is None:
        return {"bound": 0.0, "reason": reason, "score": None, "reachable": reachable}
    bound, score = placed.score_from(q, above=above, enough=request.enough)
    return {
        "bound": bound,
        "reason": "",
        "score": None if score is None else dataclasses.asdict(score),
        "reachable": reachable,
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
    image = next(imaging_configurations(placed.scene, *placed.grasps), None)
    return image, UNSEEN if image is None else ""


def _evaluation(content: dict[str, Any]) -> Evaluation:
    score = content["score"]
    return Evaluation(
        bound=content["bound"],
        score=None if score is None else PoseScore(**score),
        reason=content["reason"],
        reachable_share=content["reachable"],
    )
