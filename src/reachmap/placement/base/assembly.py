"""From the searches for each arm and mounting to the robot placement."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.cell.base_pose import T_world_bin_of, heading_rad
from reachmap.cell.loaded import LoadedCell
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from reachmap.errors import SceneError
from reachmap.maps import RunClock
from reachmap.maps.base.record import BasePlacement
from reachmap.maps.records import Stamp
from reachmap.placement.base.mounting import RailMounting
from reachmap.placement.base.problem import BaseProblem
from reachmap.placement.base.search import BaseOutcome
from reachmap.placement.base.settings import base_settings
from reachmap.placement.decision import NO_ROW
from reachmap.placement.mapped.candidates import Candidate
from reachmap.placement.mapped.exact import Pose
from reachmap.placement.predicted.places import rank_key
from reachmap.scans.document import (
    checking_settings,
    provenance_from_document,
    scan_document,
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BaseSearch:
    """One arm in one mounting, and its outcome.

    Attributes
    ----------
    arm, mounting : int
        Of what is compared.
    loaded : LoadedCell
        With this arm, in its own world.
    problem : BaseProblem
    outcome : BaseOutcome
    T_world_level : array, shape (4, 4)
    is_own : bool
        Whether the base is mounted as the cell has it.
    """

    arm: int
    mounting: int
    loaded: LoadedCell
    problem: BaseProblem
    outcome: BaseOutcome
    T_world_level: FloatArray
    is_own: bool

    def pose(self, row: int) -> Pose:
        """Pose of a row of its table."""
        return self.outcome.decision.table.rows[row].pose


def base_placement(
    searches: Sequence[BaseSearch],
    arms: tuple[str, ...],
    mountings: tuple[str, ...],
    settings: Mapping[str, Any],
    *,
    rail: str,
    clock: RunClock,
) -> BasePlacement:
    """One table of all searches, and the best of them all.

    Parameters
    ----------
    searches : sequence of BaseSearch
        Of each arm in each mounting; the first is that of the cell's own arm.
    arms, mountings : tuple of str
    settings : mapping
        What was asked for, as stored.
    rail : str
    clock : RunClock

    Raises
    ------
    SceneError
        No place serves.
    """
    first = np.cumsum([0, *(len(s.outcome.decision.table.rows) for s in searches)])
    found = [k for k, s in enumerate(searches) if s.outcome.chosen != NO_ROW]
    if not found:
        raise SceneError(_nowhere(searches))
    ranked = sorted(found, key=lambda k: _rank(searches[k]))
    best = searches[ranked[0]]
    rows = [row for s in searches for row in s.outcome.decision.table.rows]
    assert best.outcome.scan is not None
    final = _final_cell(best)
    document = _document(final, settings)
    places, headings = _in_world(searches)
    return BasePlacement(
        base_pose=final.cell.robot.base_pose.matrix(),
        bin_pose=T_world_bin_of(final.cell),
        scan_configuration=np.array(best.outcome.scan.q),
        joint_names=tuple(document["joint_names"]),
        rail=rail,
        chosen=int(first[ranked[0]]) + best.outcome.chosen,
        runner_up=_runner_up(searches, ranked, first, rows),
        present=_present(searches, first),
        arms=arms,
        mountings=mountings,
        best_of=_best_of(searches, found, first, (len(arms), len(mountings))),
        arm=np.repeat([s.arm for s in searches], np.diff(first)),
        mounting=np.repeat([s.mounting for s in searches], np.diff(first)),
        candidate_position=places,
        candidate_yaw=headings,
        **{
            name: np.concatenate(
                [getattr(s.outcome.decision.table, how)(*of) for s in searches]
            )
            for name, how, of in _COLUMNS
        },
        reason=tuple(row.reason for row in rows),
        margin=best.outcome.margin,
        T_world_level=best.T_world_level,
        stamp=Stamp(**document["stamp"]),
        provenance=provenance_from_document(document),
        run=clock.finish(),
    )


def _document(final: LoadedCell, settings: Mapping[str, Any]) -> dict[str, Any]:
    scene = Scene.build(final, with_bin=True)
    scene.require_free_scan_configuration()
    return scan_document(
        scene,
        kind="base_placement",
        method="search",
        settings={
            **checking_settings(scene),
            "roadmap": final.cell.roadmap.model_dump(mode="json"),
            "base_placement": base_settings() | dict(settings),
        },
    )


def _present(searches: Sequence[BaseSearch], first: IntArray) -> int:
    """Row of the cell as it is, -1 where it is in none of the searches."""
    for k, search in enumerate(searches):
        if search.arm == 0 and search.is_own and search.outcome.present != NO_ROW:
            return int(first[k]) + search.outcome.present
    return NO_ROW


def _runner_up(
    searches: Sequence[BaseSearch],
    ranked: Sequence[int],
    first: IntArray,
    rows: Sequence[Candidate],
) -> int:
    """Best row elsewhere, or of another arm or mounting, -1 for none."""
    rivals = [int(first[k]) + searches[k].outcome.chosen for k in ranked[1:]]
    best = searches[ranked[0]].outcome
    if best.runner_up != NO_ROW:
        rivals.append(int(first[ranked[0]]) + best.runner_up)
    return min(rivals, key=lambda k: rank_key(rows[k]), default=NO_ROW)


def _best_of(
    searches: Sequence[BaseSearch],
    found: Sequence[int],
    first: IntArray,
    shape: tuple[int, int],
) -> IntArray:
    best = np.full(shape, NO_ROW)
    for k in found:
        chosen = int(first[k]) + searches[k].outcome.chosen
        best[searches[k].arm, searches[k].mounting] = chosen
    return best


_COLUMNS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("score", "values", ("score",)),
    ("score_error", "values", ("error",)),
    ("worst_point", "values", ("worst_point",)),
    ("reachable_share", "values", ("reachable_share",)),
    ("exact", "exact", ()),
)


def _rank(search: BaseSearch) -> Any:
    return rank_key(search.outcome.decision.table.rows[search.outcome.chosen])[:3]


def _nowhere(searches: Sequence[BaseSearch]) -> str:
    reasons = sorted(
        {r for s in searches for r in s.outcome.decision.table.reasons() if r}
    )
    why = f" ({'; '.join(reasons[:4])})" if reasons else ""
    return (
        f"{searches[0].loaded.source}: the arm reaches the bin from nowhere in the "
        f"region that was searched{why}"
    )


def _final_cell(search: BaseSearch) -> LoadedCell:
    """The cell in its own world, with its base and scan configuration."""
    scan = search.outcome.scan
    assert scan is not None
    pose = search.pose(search.outcome.chosen)
    placed = search.problem.mounting.final(search.loaded, pose, search.T_world_level)
    names = RobotModel.from_cell(placed).joint_names
    return placed.with_changes(
        scan_configuration_rad=dict(zip(names, scan.q.tolist(), strict=True))
    )


def _in_world(searches: Sequence[BaseSearch]) -> tuple[FloatArray, FloatArray]:
    """Places (n, 3) and headings (n,) of all candidates in the world."""
    places, headings = [], []
    for search in searches:
        how, T = search.problem.mounting, search.T_world_level
        for row in search.outcome.decision.table.rows:
            if isinstance(how, RailMounting):
                places.append(np.array([row.pose[0], 0.0, 0.0]))
                headings.append(0.0)
                continue
            T_world_base = T @ how.T_level_base(row.pose)
            places.append(T_world_base[:3, 3])
            headings.append(heading_rad(T_world_base[:3, :3]))
    return np.array(places).reshape(-1, 3), np.array(headings, float)
