"""One grasp list through one ranker: placed, matched, ranked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from reachmap import __version__
from reachmap._typing import FloatArray
from reachmap.errors import SettingsError
from reachmap.geometry import rotation_from_quaternion_wxyz, transform_from_parts
from reachmap.maps.bytes.to_json import json_ready
from reachmap.maps.cycle.seconds import throughput_of
from reachmap.ranking.answers.plausibility import plausibility_warnings
from reachmap.ranking.answers.ranked_list import RankedList
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lookup.costs import Ranking
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.queries import place_grasps, queries_from_arrays
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.ranking.lookup.settings import RankSettings
from reachmap.ranking.lookup.table import TERMS


def rank_list(
    grasps: GraspList,
    ranker: Ranker,
    *,
    settings: RankSettings | None = None,
    T_base_frame: FloatArray | None = None,
) -> RankedList:
    """Rank a grasp list.

    Parameters
    ----------
    grasps : GraspList
    ranker : Ranker
    settings : RankSettings, optional
    T_base_frame : array, shape (4, 4), optional
        Pose of the list's frame in robot_base, where the cell does not know it.

    Raises
    ------
    GraspListError
        The list is in an unknown frame.
    """
    settings = settings or RankSettings()

    def queries_of(one: GraspList) -> Queries:
        axis = ranker.table.approach_axis
        placed = place_grasps(one, ranker.frames, axis, T_base_frame)
        return queries_from_arrays(
            ranker.table,
            placed.points,
            placed.directions,
            placed.rotations,
            roll=settings.roll,
            invalid=settings.invalid,
        )

    queries = queries_of(grasps)
    ranking = ranker.rank_queries(queries, settings, grasps.scores)
    return RankedList(
        grasps=grasps,
        queries=queries,
        ranking=ranking,
        asked=settings,
        header=_header(ranker, settings, ranking),
        doubts=plausibility_warnings(
            grasps,
            ranking,
            lambda other: ranker.rank_queries(queries_of(other), settings),
        ),
    )


def _cost_facts(
    ranker: Ranker, settings: RankSettings, ranking: Ranking
) -> Mapping[str, Any]:
    """What the cost is; for seconds also what a failure costs and picks per hour."""
    if settings.cost == "paper":
        return {"cost": "paper"}
    made = throughput_of(ranking.cost)
    return {
        "cost": "cycle",
        "failure_cost_s": ranker.failure_cost_s(settings),
        "picks_per_hour": None if made is None else json_ready(asdict(made)),
    }


def _header(
    ranker: Ranker, settings: RankSettings, ranking: Ranking
) -> Mapping[str, Any]:
    table = ranker.table
    maxima = dict(zip(TERMS, table.maxima.tolist(), strict=True))
    scale = dict(zip(TERMS, table.scale.tolist(), strict=True))
    return {
        "version": __version__,
        "map_sha256": ranker.stamp.content_sha256,
        "cost_table_sha256": ranker.cost_table_sha256,
        "cell_sha256": ranker.stamp.cell_sha256,
        "calibration": _calibration_facts(ranker),
        **_cost_facts(ranker, settings, ranking),
        "weights": list(settings.weights),
        "likeness": settings.likeness,
        **({"margins": dict(settings.margins)} if settings.margins else {}),
        "neighbours": settings.neighbours,
        "roll": settings.roll,
        "max_angle_deg": settings.max_angle_deg,
        "normalise": table.basis.normalise,
        "planning_time": table.basis.planning_time,
        "scale": scale,
        "maxima": maxima,
    }


def _calibration_facts(ranker: Ranker) -> Mapping[str, Any] | None:
    known = ranker.calibration
    if known is None:
        return None
    return {"grasps": known.grasps, "error": known.error}


def pose_from_numbers(values: Sequence[float]) -> FloatArray:
    """Pose of x, y, z [m] and a unit quaternion qw, qx, qy, qz, shape (4, 4).

    Raises
    ------
    SettingsError
        There are not seven numbers, or the quaternion is none.
    """
    pose = np.asarray(values, float)
    norm = float(np.linalg.norm(pose[3:])) if pose.shape == (7,) else np.nan
    if not (np.isfinite(pose).all() and abs(norm - 1.0) < 1e-2):
        raise SettingsError(
            "a frame pose is x y z [m] and a unit quaternion qw qx qy qz "
            f"(got {pose.tolist()})"
        )
    return transform_from_parts(rotation_from_quaternion_wxyz(pose[3:]), pose[:3])
