"""The decision on a placement: by the paper's rule, as given, or by a search."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.collision.bin_fit import BinFit
from reachmap.errors import SceneError
from reachmap.maps.records import Status
from reachmap.maps.summary.statistics import most_likely_cause
from reachmap.placement.mapped.candidates import Candidate, CandidateTable
from reachmap.placement.mapped.exact import PlacedScene, Pose, pose_of_bin
from reachmap.placement.mapped.imaging import UNSEEN
from reachmap.placement.mapped.sample import THIN, sample_of
from reachmap.placement.margins import MARGIN_POSES, margins
from reachmap.placement.paper_rule import LatticePoint, choose_by_paper
from reachmap.placement.predicted.places import apart_m, rank_key
from reachmap.placement.problem import PlacementProblem
from reachmap.placement.scan_choice import FINALISTS, ScanChoice, choose_scan
from reachmap.placement.steadying import stated_worst
from reachmap.sampling.frames import approach_distance_m
from reachmap.scans.ik_survey import survey_frames

logger = logging.getLogger(__name__)

NO_ROW = -1
# Poses to look at, at most, once the pose of the bin is decided.
SETTLING = FINALISTS + MARGIN_POSES
REMEDY = (
    "look at camera.range_m and camera.field_of_view_deg, or leave the cell's own "
    "configuration with --keep-scan-configuration"
)


@dataclass(slots=True, kw_only=True)
class Decision:
    """Candidates, and the rows of the table that matter.

    ``ranked`` are the rows that were mapped exactly, best first.
    """

    table: CandidateTable = field(default_factory=CandidateTable)
    ranked: list[int] = field(default_factory=list)
    paper: int = NO_ROW

    def rank(
        self, preferred: Sequence[Pose] = (), unfit: Collection[Pose] = ()
    ) -> None:
        """Sort the rows that were mapped exactly, some poses before all others.

        Poses that are unfit are left out.
        """
        rows = self.table.rows
        place = {pose: k for k, pose in enumerate(preferred)}
        exact = [k for k, r in enumerate(rows) if r.exact and r.pose not in unfit]
        self.ranked = sorted(
            exact,
            key=lambda k: (place.get(rows[k].pose, len(place)), rank_key(rows[k])),
        )

    def runner_up(self, pose: Pose, distance_m: float) -> int:
        """Best row in another place than a pose, or -1."""
        rows = self.table.rows
        return next(
            (
                k
                for k in self.ranked
                if rows[k].score is not None
                and apart_m(rows[k].pose, pose) >= distance_m
            ),
            NO_ROW,
        )


def decide_by_paper(problem: PlacementProblem) -> Decision:
    """Take the paper's choice, with the map's prediction for comparison.

    Raises
    ------
    SceneError
        The bin can stand nowhere on the map.
    """
    decision = Decision()
    for place in problem.predicted():
        decision.table.add(place)
    pose = paper_pose(problem)
    if pose is None:
        raise SceneError(nowhere(problem, decision.table))
    problem.evaluator.expect(1 + SETTLING)
    decision.paper = decision.table.add(problem.exact([pose])[0])
    decision.rank()
    if not decision.ranked:
        raise SceneError(nowhere(problem, decision.table))
    return decision


def decide_as_given(problem: PlacementProblem, pose: Pose) -> Decision:
    """Score a pose given by the user, and the paper's for comparison.

    Raises
    ------
    SceneError
        The bin would collide with something; both are named.
    """
    contact = problem.fit.contact(problem.T_base_bin(pose))
    if contact is not None:
        raise SceneError(f"--bin-pose: {contact.pair}")
    taken = problem.without_room(pose)
    if taken:
        logger.warning("--bin-pose: %s", taken)
    decision = Decision()
    paper = paper_pose(problem)
    poses = [pose] if paper is None or paper == pose else [pose, paper]
    problem.evaluator.expect(len(poses) + SETTLING)
    for candidate in problem.exact(poses):
        row = decision.table.add(candidate)
        if candidate.pose == paper:
            decision.paper = row
    given = decision.table.rows[0]
    if given.score is None:
        raise SceneError(f"--bin-pose: {given.reason}")
    decision.ranked = [0]
    return decision


def paper_pose(problem: PlacementProblem) -> Pose | None:
    """Pose that the paper's rule takes: the first of its points that is feasible.

    The centre of the inner bottom is put on the point, at the cell's own angle or, if
    the bin cannot stand there like that, turned by 90 degrees.
    """
    workspace, cell = problem.workspace, problem.loaded.cell
    yaw = pose_of_bin(cell)[3]
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
            if not problem.reason_against((x, y, z, angle), floats=True):
                found.append((x, y, z, angle))
                return True
        return False

    choose_by_paper(workspace, is_feasible)
    return found[0] if found else None


def nowhere(problem: PlacementProblem, table: CandidateTable) -> str:
    """Error that the bin fits nowhere, with the reasons of a table."""
    reasons = sorted({reason for reason in table.reasons() if reason})
    why = f" ({'; '.join(reasons[:4])})" if reasons else ""
    return f"{problem.loaded.source}: the bin can stand nowhere in the region{why}"


def why_no_place(problem: PlacementProblem, decision: Decision) -> str:
    """Reason why no pose reaches a single test frame; "" where one does."""
    best = decision.table.rows[decision.ranked[0]]
    if best.score is None or best.score.score > 0.0:
        return ""
    sample = sample_of(problem.loaded.cell, THIN, problem.is_open)
    placed = PlacedScene(problem.moving, best.pose, sample)
    approach_m = approach_distance_m(problem.loaded.cell)
    survey = survey_frames(placed.scene, placed.T, approach_m)
    status = survey.status.copy()
    status[status == Status.NOT_ATTEMPTED] = Status.NO_PATH_FOUND
    pairs = placed.scene.checker.body_pairs
    why = most_likely_cause(status, survey.blocking_pair, pairs)
    x, y, z, yaw = best.pose
    return (
        f"{problem.loaded.source}: no place for the bin: even at x={x:.3f} y={y:.3f} "
        f"z={z:.3f} yaw={np.degrees(yaw):.0f} {why}"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """The final decision, from which the artefact is made.

    Attributes
    ----------
    chosen, runner_up, paper_choice : int
        Rows of the table, -1 for none.
    scan : ScanChoice
    margin : dict
        See :func:`reachmap.placement.margins.margins`.
    """

    chosen: int
    runner_up: int
    paper_choice: int
    scan: ScanChoice
    margin: dict[str, float]


def settle(problem: PlacementProblem, decision: Decision) -> Outcome:
    """Choose the best pose that can be imaged, and its scan configuration.

    Parameters
    ----------
    problem : PlacementProblem
    decision : Decision
        Its table gets a row for the chosen pose as seen from a new configuration,
        and reasons where there is none.

    Raises
    ------
    SceneError
        No pose that was mapped can be imaged.
    """
    rows = decision.table.rows
    for row in decision.ranked:
        problem.evaluator.expect(SETTLING)
        scan = _scan(problem, rows[row])
        if scan is None:
            rows[row] = Candidate(pose=rows[row].pose, exact=True, reason=UNSEEN)
            continue
        pose = rows[row].pose
        if not problem.tolerance.is_none:
            # What was confirmed before is known.
            worst = stated_worst(problem, rows[row])
            rows[row] = dataclasses.replace(rows[row], worst=worst)
        chosen = row
        if scan.is_new:
            chosen = decision.table.add(_from_scan(rows[row], scan))
        return Outcome(
            chosen=chosen,
            runner_up=decision.runner_up(pose, problem.different_place_m),
            paper_choice=_paper_row(decision, row, chosen),
            scan=scan,
            margin=_margins(problem, pose, scan.q),
        )
    raise SceneError(f"{problem.loaded.source}: {UNSEEN}; {REMEDY}")


def _from_scan(candidate: Candidate, scan: ScanChoice) -> Candidate:
    """A candidate scored from another scan configuration."""
    worst = candidate.worst
    if worst is not None and candidate.score is not None:
        worst = max(worst + scan.score.score - candidate.score.score, 0.0)
    return dataclasses.replace(candidate, score=scan.score, worst=worst)


def _scan(problem: PlacementProblem, candidate: Candidate) -> ScanChoice | None:
    if not problem.keep_scan:
        sample = sample_of(problem.loaded.cell, THIN, problem.is_open)
        placed = PlacedScene(problem.moving, candidate.pose, sample)
        return choose_scan(placed, problem.evaluator)
    if not problem.can_be_imaged(candidate.pose):
        return None
    assert candidate.score is not None
    q: FloatArray = np.array(problem.scene.scan_configuration)
    return ScanChoice(q=q, score=candidate.score, is_new=False)


def _margins(problem: PlacementProblem, pose: Pose, q: FloatArray) -> dict[str, float]:
    """Margins with the arm at a scan configuration, the region left aside."""
    fit = BinFit(problem.scene.robot, problem.loaded, q)
    return margins(
        pose,
        q,
        lambda moved: not problem.obstruction(moved, fit),
        problem.evaluator,
    )


def _paper_row(decision: Decision, row: int, chosen: int) -> int:
    """Row of the paper's choice; the chosen row if that is what was chosen."""
    return chosen if decision.paper == row else decision.paper
