"""A grasp list through a ranker: the same document, re-ordered, with reasons."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from reachmap import __version__
from reachmap._typing import FloatArray
from reachmap.errors import SettingsError
from reachmap.geometry import rotation_from_quaternion_wxyz, transform_from_parts
from reachmap.maps.bytes.to_json import json_ready
from reachmap.maps.cycle.seconds import throughput_of
from reachmap.ranking.answers.plausibility import plausibility_warnings
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lookup.costs import (
    INVALID,
    LIKENESS,
    OUTSIDE_MAP,
    Ranking,
    status_name,
)
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.queries import place_grasps, queries_from_arrays
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.ranking.lookup.settings import MARGINS, RankSettings
from reachmap.ranking.lookup.table import TERMS

TERM_NAMES = (*TERMS, LIKENESS, *MARGINS)
QUADRANT_ORDER = ("NW", "NE", "SW", "SE", None)


@dataclass(frozen=True, slots=True, kw_only=True)
class RankedList:
    """A grasp list with its ranking.

    Attributes
    ----------
    grasps : GraspList
    queries : Queries
        The grasps in robot_base, as they were matched.
    ranking : Ranking
        Rows in supplied order.
    asked : RankSettings
        What it was ranked with.
    header : mapping
        The same and the map's identity, as written to the document.
    doubts : tuple of str
        Questions that the list as a whole raises.
    """

    grasps: GraspList
    queries: Queries
    ranking: Ranking
    asked: RankSettings
    header: Mapping[str, Any]
    doubts: tuple[str, ...] = ()

    def terms(self) -> dict[str, FloatArray]:
        """Summands of the cost that were asked for, by name, each of shape (n,)."""
        named = zip(self.ranking.term_names, self.ranking.terms.T, strict=True)
        return {
            name: values
            for name, values in named
            if name != LIKENESS or self.asked.likeness
        }

    @property
    def in_seconds(self) -> bool:
        """Whether the cost is in predicted seconds per pick."""
        return self.asked.cost == "cycle"

    def counts(self) -> dict[str, int]:
        """How many grasps ended in which status, most frequent first."""
        codes, numbers = np.unique(self.ranking.status, return_counts=True)
        found = {status_name(c): int(n) for c, n in zip(codes, numbers, strict=True)}
        return dict(sorted(found.items(), key=lambda item: (-item[1], item[0])))


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


def quadrant_ranks(
    order: Iterable[int], quadrants: tuple[str | None, ...]
) -> list[int | None]:
    """Rank of each grasp among those of its quadrant, from 1, in supplied order."""
    seen: dict[str, int] = {}
    ranks: list[int | None] = [None] * len(quadrants)
    for row in order:
        quadrant = quadrants[row]
        if quadrant is not None:
            seen[quadrant] = ranks[row] = seen.get(quadrant, 0) + 1
    return ranks


def ranked_document(ranked: RankedList, top: int | None = None) -> dict[str, Any]:
    """Build the document with its grasps re-ordered by cost.

    Every object keeps what it held and gains an object ``reachmap``. What an earlier
    ranking said is replaced.

    Parameters
    ----------
    ranked : RankedList
    top : int, optional
        Keep only this many of the best.
    """
    document = dict(ranked.grasps.document)
    supplied = document.pop("grasps")
    order = ranked.ranking.order[:top].tolist()
    results = _results(ranked)
    document["reachmap"] = {
        **ranked.header,
        "counts": ranked.counts(),
        "doubts": list(ranked.doubts),
    }
    document["grasps"] = [{**supplied[row], "reachmap": results[row]} for row in order]
    return document


def document_text(document: Mapping[str, Any]) -> str:
    """Return JSON text with one grasp a line."""
    header = {key: value for key, value in document.items() if key != "grasps"}
    lines = [f"{_json(key)}: {_json(value)}" for key, value in header.items()]
    grasps = ",\n  ".join(_json(grasp) for grasp in document["grasps"])
    lines.append(f'"grasps": [\n  {grasps}\n ]' if grasps else '"grasps": []')
    return "{\n " + ",\n ".join(lines) + "\n}\n"


def _json(value: Any) -> str:
    # ASCII: text from elsewhere may hold halves of characters, which UTF-8 cannot.
    return json.dumps(value, allow_nan=False)


def _results(ranked: RankedList) -> list[dict[str, Any]]:
    """Build the ``reachmap`` object of each grasp, in supplied order."""
    ranking, quadrants = ranked.ranking, ranked.grasps.quadrants
    after = quadrant_ranks(ranking.order.tolist(), quadrants)
    before = quadrant_ranks(range(len(quadrants)), quadrants)
    named = ranked.terms()
    columns = zip(
        ranking.rank.tolist(),
        after,
        before,
        ranking.cost.tolist(),
        np.stack([*named.values()], axis=1).tolist(),
        ranking.status.tolist(),
        ranking.test_grasp.tolist(),
        ranking.distance.tolist(),
        ranking.angle.tolist(),
        ranking.orientation_wxyz.tolist(),
        ranking.probability.tolist(),
        ranking.extrapolated.tolist(),
        strict=True,
    )
    names = tuple(named)
    results = [_result(row, names, row_of) for row, row_of in enumerate(columns, 1)]
    if ranked.in_seconds:
        results = [{**result, "seconds": result["cost"]} for result in results]
    return results


def _result(
    supplied: int, names: tuple[str, ...], values: tuple[Any, ...]
) -> dict[str, Any]:
    rank, after, before, cost, terms, code, test_grasp, *rest = values
    phi1, phi2, wxyz, probability, far = rest
    reachable = bool(np.isfinite(cost))
    inside = code not in (OUTSIDE_MAP, INVALID)
    quadrant = {"quadrant_rank": after, "original_quadrant_rank": before}
    named = dict(zip(names, terms, strict=True))
    return {
        "rank": rank,
        "original_rank": supplied,
        **(quadrant if after is not None else {}),
        "cost": cost if reachable else None,
        "terms": named if reachable else None,
        "probability": probability if np.isfinite(probability) else None,
        "status": status_name(code),
        "test_grasp": test_grasp[1:] if inside else None,
        "layer": test_grasp[0] if inside else None,
        "distance": None if code == INVALID else phi1,
        "angle": None if code == INVALID else phi2,
        "orientation_wxyz": wxyz if reachable else None,
        **({"extrapolated": True} if far else {}),
    }
