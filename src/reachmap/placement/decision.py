"""Decides where the bin goes: by search, by the paper's rule, or as told."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.core.bin_fit import BinFit
from reachmap.core.scene import Scene
from reachmap.errors import SceneError
from reachmap.geometry import yaw_transform
from reachmap.maps.records import WorkspaceMap
from reachmap.placement import margins, refine
from reachmap.placement.candidates import Candidate, CandidateTable
from reachmap.placement.evaluator import Evaluator
from reachmap.placement.exact import ALWAYS, Pose
from reachmap.placement.field import field_of
from reachmap.placement.footprint import footprint_of
from reachmap.placement.paper_rule import LatticePoint, choose_by_paper
from reachmap.placement.places import (
    apart_m,
    best_at_each_place,
    pose_grid,
    rank_key,
    spread_out,
)
from reachmap.placement.prediction import predict
from reachmap.placement.region import Region
from reachmap.placement.scan_choice import FINALISTS

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

TURNS_DEG = (45.0, 90.0, 135.0)
PLACES_IMPROVED = 2
# Poses to look at, at most: while turning, and once the pose is decided.
MOST_TURNS = PLACES_IMPROVED * len(TURNS_DEG)
SETTLING = FINALISTS + margins.MOST_POSES
NO_ROW = -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Question:
    """What is asked: a cell, its workspace map, and where the bin may stand.

    Attributes
    ----------
    loaded : LoadedCell
    workspace : WorkspaceMap
    is_open : bool array, shape (layers, y, x, orientations)
        See :func:`reachmap.placement.sample.open_frames`.
    region : Region
    scene : Scene
        Without the bin.
    keep_scan : bool
        Whether the cell's own scan configuration stays.
    fit : BinFit
        With the arm at the scan configuration if that stays, else without the arm.
    evaluator : Evaluator
    """

    loaded: LoadedCell
    workspace: WorkspaceMap
    is_open: BoolArray
    region: Region
    scene: Scene
    keep_scan: bool
    fit: BinFit
    evaluator: Evaluator

    @property
    def different_place_m(self) -> float:
        """Distance of centres from which two bins stand in different places."""
        return max(self.loaded.cell.bin.inner[:2]) / 2

    def reason_against(self, pose: Pose) -> str:
        """Why the bin cannot stand at a pose, or ""."""
        outside = self.region.outside(np.array(pose))
        if outside:
            return f"{outside} is outside the region"
        contact = self.fit.contact(yaw_transform(*pose))
        return "" if contact is None else contact.reason

    @property
    def start(self) -> FloatArray | None:
        """Scan configuration that poses are mapped from, None if it is chosen later."""
        return self.scene.scan_configuration if self.keep_scan else None

    def exact(
        self, poses: Sequence[Pose], *, above: float | Sequence[float] = ALWAYS
    ) -> list[Candidate]:
        """Map poses with the bin in the scene.

        Poses whose bound is not above a score are left out; those without a scan
        configuration come with the reason.
        """
        found = self.evaluator.evaluate(poses, self.start, above=above)
        return [
            Candidate(
                pose=pose, score=e.score, exact=e.score is not None, reason=e.reason
            )
            for pose, e in zip(poses, found, strict=True)
            if e.score is not None or e.reason
        ]


@dataclass(slots=True, kw_only=True)
class Decision:
    """Candidates, and the rows of the table that matter.

    ``ranked`` are the rows that were mapped exactly, best first.
    """

    table: CandidateTable = field(default_factory=CandidateTable)
    ranked: list[int] = field(default_factory=list)
    paper: int = NO_ROW

    def rank(self) -> None:
        """Sort the rows that were mapped exactly."""
        rows = self.table.rows
        exact = [k for k, row in enumerate(rows) if row.exact]
        self.ranked = sorted(exact, key=lambda k: rank_key(rows[k]))

    def runner_up(self, pose: Pose, distance_m: float) -> int:
        """Best row in another place than a pose, or -1."""
        rows = self.table.rows
        return next(
            (k for k in self.ranked if apart_m(rows[k].pose, pose) >= distance_m),
            NO_ROW,
        )


def decide_by_search(question: Question, top: int) -> Decision:
    """Search x, y, z and yaw.

    Parameters
    ----------
    question : Question
    top : int
        Different places that are mapped with the bin in the scene.

    Raises
    ------
    SceneError
        The bin can stand nowhere.
    """
    decision = Decision()
    places = _predicted(question)
    for place in places:
        decision.table.add(place)
    finalists = spread_out(places, top, question.different_place_m)
    paper = paper_pose(question)
    poses = [c.pose for c in finalists] + ([] if paper is None else [paper])
    question.evaluator.expect(len(poses) + MOST_TURNS + refine.MOST_POSES + SETTLING)
    mapped = question.exact(poses)
    scored = sorted((c for c in mapped if c.score is not None), key=rank_key)
    better = _improved(question, scored[:PLACES_IMPROVED])
    mapped += question.exact([pose for pose in better if pose not in poses])
    for candidate in {c.pose: c for c in mapped}.values():
        row = decision.table.add(candidate)
        if candidate.pose == paper:
            decision.paper = row
    decision.rank()
    if not decision.ranked:
        raise SceneError(_nowhere(question, decision.table))
    return decision


def decide_by_paper(question: Question) -> Decision:
    """Take the paper's choice, with the map's prediction for comparison.

    Raises
    ------
    SceneError
        The bin can stand nowhere on the map.
    """
    decision = Decision()
    for place in _predicted(question):
        decision.table.add(place)
    pose = paper_pose(question)
    if pose is None:
        raise SceneError(_nowhere(question, decision.table))
    question.evaluator.expect(1 + SETTLING)
    decision.paper = decision.table.add(question.exact([pose])[0])
    decision.rank()
    if not decision.ranked:
        raise SceneError(_nowhere(question, decision.table))
    return decision


def decide_as_given(question: Question, pose: Pose) -> Decision:
    """Score a pose that the user has in mind, and the paper's beside it.

    Raises
    ------
    SceneError
        The bin would meet something; both are named.
    """
    contact = question.fit.contact(yaw_transform(*pose))
    if contact is not None:
        raise SceneError(f"--bin-pose: {contact.pair}")
    decision = Decision()
    paper = paper_pose(question)
    poses = [pose] if paper is None or paper == pose else [pose, paper]
    question.evaluator.expect(len(poses) + SETTLING)
    for candidate in question.exact(poses):
        row = decision.table.add(candidate)
        if candidate.pose == paper:
            decision.paper = row
    given = decision.table.rows[0]
    if given.score is None:
        raise SceneError(f"--bin-pose: {given.reason}")
    decision.ranked = [0]
    return decision


def paper_pose(question: Question) -> Pose | None:
    """Pose that the paper's rule takes: the first of its points that is feasible.

    The centre of the inner bottom is put on the point, at the cell's own angle or, if
    the bin cannot stand there like that, turned by 90 degrees.
    """
    workspace, bin_pose = question.workspace, question.loaded.cell.bin.pose.matrix()
    yaw = float(np.arctan2(bin_pose[1, 0], bin_pose[0, 0]))
    found: list[Pose] = []

    def is_feasible(point: LatticePoint) -> bool:
        x, y, z = (
            float(axis[k])
            for axis, k in (
                (workspace.x, point.x),
                (workspace.y, point.y),
                (workspace.z, point.z),
            )
        )
        for angle in (yaw, yaw + np.pi / 2):
            if not question.reason_against((x, y, z, angle)):
                found.append((x, y, z, angle))
                return True
        return False

    choose_by_paper(workspace, is_feasible)
    return found[0] if found else None


def _predicted(question: Question) -> list[Candidate]:
    """Best pose at each place, by interpolation of the map."""
    workspace = question.workspace
    grid = pose_grid(question.region, workspace.x, workspace.y, workspace.z)
    footprint = footprint_of(question.loaded.cell, question.is_open)
    prediction = predict(field_of(workspace), footprint, grid)
    return list(best_at_each_place(prediction, question.reason_against))


def _improved(question: Question, starts: list[Candidate]) -> list[Pose]:
    """Better poses near some places: turned first, then the best of all moved.

    A pose counts as better by a quarter of a point.
    """
    if not starts:
        return []
    evaluator = question.evaluator
    evaluator.expect(MOST_TURNS + refine.MOST_POSES + SETTLING)
    best = _turned(question, starts)
    evaluator.expect(refine.MOST_POSES + SETTLING)
    moved = refine.refine(
        min(best, key=rank_key),
        question.start,
        question.region,
        question.reason_against,
        evaluator,
    )
    return list(dict.fromkeys([moved.pose, *(c.pose for c in best)]))


def _turned(question: Question, starts: list[Candidate]) -> list[Candidate]:
    """Each of some candidates, or a better one at the same place."""
    turns = {
        pose: start
        for start in starts
        for pose in (_with_turn(start.pose, turn, question) for turn in TURNS_DEG)
        if not question.reason_against(pose)
    }
    above = [
        start.score.score + refine.MIN_GAIN_POINTS
        for start in turns.values()
        if start.score is not None
    ]
    found = question.exact(list(turns), above=above)
    better = [c for c in found if c.score is not None]
    return [
        min([start, *(c for c in better if turns[c.pose] is start)], key=rank_key)
        for start in starts
    ]


def _with_turn(pose: Pose, turn_deg: float, question: Question) -> Pose:
    low = float(question.region.low[3])
    yaw = low + (pose[3] + np.radians(turn_deg) - low) % np.pi
    return (*pose[:3], round(float(yaw), 9))


def _nowhere(question: Question, table: CandidateTable) -> str:
    reasons = sorted({reason for reason in table.reasons() if reason})
    why = f" ({'; '.join(reasons[:4])})" if reasons else ""
    return f"{question.loaded.source}: the bin can stand nowhere in the region{why}"
