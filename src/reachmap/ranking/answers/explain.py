"""Explanation of one grasp: its test grasp, the attempts at it, its cost, its rank."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reachmap._typing import FloatArray
from reachmap.errors import SettingsError
from reachmap.maps.records import BinMap, Status
from reachmap.ranking.answers.ranked_list import RankedList, quadrant_ranks
from reachmap.ranking.lookup.costs import OUTSIDE_MAP, UNLIKE_MAP, status_name
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.ranker import Ranker
from reachmap.text import printable

# A choice: what fits on a screen.
LISTED_TIES = 12


def find_grasp(ranked: Sequence[RankedList], name: str) -> tuple[RankedList, int]:
    """Find the one grasp with an id among several lists.

    Parameters
    ----------
    ranked : sequence of RankedList
    name : str
        An id, or ``#k`` for the k-th supplied grasp.

    Raises
    ------
    SettingsError
        There is none, or there are several.
    """
    place = int(name[1:]) - 1 if name[1:].isdecimal() and name[0] == "#" else None
    hits = [
        (one, row)
        for one in ranked
        for row, own in enumerate(one.grasps.ids)
        if own == name or row == place
    ]
    if len(hits) == 1:
        return hits[0]
    if hits:
        where = ", ".join(f"#{row + 1} of {one.grasps.source}" for one, row in hits[:6])
        raise SettingsError(f"{len(hits)} grasps match {name!a}: {where}")
    known = [printable(own) for one in ranked for own in one.grasps.ids[:6]]
    raise SettingsError(
        f"no grasp has the id {name!a}; there are {', '.join(known[:8])}, …, and #1, "
        "#2, … by place in the list"
    )


def explanation(ranked: RankedList, row: int, ranker: Ranker, bin_map: BinMap) -> str:
    """Explain the rank of a grasp.

    Parameters
    ----------
    ranked : RankedList
    row : int
        Supplied number of the grasp, from 0.
    ranker : Ranker
    bin_map : BinMap
        The map of the ranker, for attempts and pairs of bodies.
    """
    parts = [
        ("", _headline(ranked, row)),
        ("grasp", _grasp_line(ranked.queries, row)),
        ("test grasp", _match_line(ranked, row, ranker)),
    ]
    if ranked.ranking.status[row] == OUTSIDE_MAP:
        parts.append(("cost", "none: the map says nothing about this place"))
    elif ranked.ranking.status[row] == UNLIKE_MAP:
        parts.append(("cost", "none: no orientation of the map is near enough"))
    else:
        parts += [
            ("attempts", _attempts_line(ranked, row, ranker, bin_map)),
            ("cost", _cost_line(ranked, row, bin_map)),
            ("probability", _probability_line(ranked, row)),
            *(("tie", line) for line in _tie_lines(ranked, row, ranker, bin_map)),
        ]
    return "\n".join(f"  {name:<10}  {text}" if name else text for name, text in parts)


def _headline(ranked: RankedList, row: int) -> str:
    ranking, quadrants = ranked.ranking, ranked.grasps.quadrants
    text = (
        f"{printable(ranked.grasps.ids[row], 60)} of {ranked.grasps.source}: rank "
        f"{ranking.rank[row]} of {len(quadrants)}, supplied as {row + 1}"
    )
    if quadrants[row]:
        after = quadrant_ranks(ranking.order.tolist(), quadrants)[row]
        before = quadrant_ranks(range(len(quadrants)), quadrants)[row]
        total = quadrants.count(quadrants[row])
        text += f"; in {quadrants[row]} rank {after} of {total}, supplied as {before}"
    return text


def _vector(values: FloatArray, digits: int = 3) -> str:
    return f"[{', '.join(f'{value:.{digits}f}' for value in values)}]"


def _grasp_line(queries: Queries, row: int) -> str:
    roll = "roll free" if queries.free[row] else "roll as given"
    return (
        f"point {_vector(queries.points[row])} m, approach "
        f"{_vector(queries.axes[row])} in robot_base, {roll}"
    )


def _match_line(ranked: RankedList, row: int, ranker: Ranker) -> str:
    ranking, table = ranked.ranking, ranker.table
    layer, y, x, orientation = ranking.test_grasp[row].tolist()
    spacing = table.spacing_rad[0 if ranking.roll_free[row] else 1]
    pitch = " × ".join(f"{1e3 * side:.1f}" for side in table.pitch_m)
    return (
        f"layer {layer}, y {y}, x {x}, orientation {orientation}; "
        f"φ1 = {1e3 * ranking.distance[row]:.1f} mm (grid {pitch} mm), "
        f"φ2 = {np.degrees(ranking.angle[row]):.1f}° "
        f"(orientations {np.degrees(spacing):.1f}° apart)"
    )


def _attempts_line(
    ranked: RankedList, row: int, ranker: Ranker, bin_map: BinMap
) -> str:
    at = tuple(ranked.ranking.test_grasp[row].tolist())
    found = bin_map.path_found[at]
    text = f"{int(found.sum())} of {found.size} found a path"
    point, orientation = np.ravel_multi_index(at[:3], ranker.table.shape[:3]), at[3]
    if ranker.table.reachable[point, orientation]:
        length, planning, execution = ranker.table.means[point, orientation]
        whose = "mean path length" if found.any() else "the roadmap's own path:"
        return (
            f"{text}; {whose} {length:.2f} rad, planning "
            f"{1e3 * planning:.1f} ms, execution {execution:.2f} s"
        )
    return f"{text}: {_cause(at, bin_map)}"


def _cause(at: tuple[int, ...], bin_map: BinMap) -> str:
    """Cause that blocks a test grasp, with the pair of bodies if known."""
    code = int(bin_map.status[at])
    pair = int(bin_map.blocking_pair[at])
    said = {
        Status.NO_IK: "no inverse-kinematics solution",
        Status.IK_IN_COLLISION: "every inverse-kinematics solution collides",
        Status.NO_PATH_FOUND: "solutions free of collision, but no path found",
        Status.PATH_FOUND: "the roadmap proves a path, but none is stored",
        Status.APPROACH_BLOCKED: "the straight approach collides",
        Status.NOT_ATTEMPTED: "not attempted",
        Status.ERROR: "the planner failed",
    }[Status(code)]
    if 0 <= pair < len(bin_map.body_pairs):
        said += f" ({bin_map.body_pairs[pair]})"
    return said


def _stage_pair(at: tuple[int, ...], bin_map: BinMap) -> str:
    """Bodies in the way of a later stage of the cycle, if any are known."""
    pairs = [] if bin_map.cycle is None else bin_map.cycle.blocking_pair[at].tolist()
    known = [bin_map.body_pairs[pair] for pair in pairs if pair >= 0]
    return f" ({known[0]})" if known else ""


def _cost_line(ranked: RankedList, row: int, bin_map: BinMap) -> str:
    ranking = ranked.ranking
    if not ranking.reachable[row]:
        at = tuple(ranking.test_grasp[row].tolist())
        return f"none: {status_name(ranking.status[row])}{_stage_pair(at, bin_map)}"
    parts = " + ".join(
        f"{values[row]:.3f} {name.removesuffix('_s').replace('_', ' ')}"
        for name, values in ranked.terms().items()
    )
    tool = _vector(ranking.orientation_wxyz[row], 4)
    total = f"{_unit(ranked)}{ranking.cost[row]:.3f}"
    return f"{total} = {parts}; tool orientation wxyz {tool}"


def _unit(ranked: RankedList) -> str:
    return "seconds per pick: " if ranked.in_seconds else "J = "


def _probability_line(ranked: RankedList, row: int) -> str:
    basis = "calibrated" if ranked.header["calibration"] else "share reached around"
    return f"{ranked.ranking.probability[row]:.3f} ({basis})"


def _tie_lines(
    ranked: RankedList, row: int, ranker: Ranker, bin_map: BinMap
) -> list[str]:
    """Return the test grasps that were as near: the rolls of one approach, mostly."""
    query = ranked.queries.take(np.array([row]))
    point, orientation = ranker.tied(query)
    if len(point) < 2:
        return []
    costs = ranker.test_costs(ranked.asked)
    lines = []
    for p, o in zip(point.tolist(), orientation.tolist(), strict=True):
        at = (*(int(i) for i in np.unravel_index(p, ranker.table.shape[:3])), o)
        cost = costs[p, o]
        said = (
            f"{_unit(ranked)}{cost:.3f}" if np.isfinite(cost) else _cause(at, bin_map)
        )
        chosen = at == tuple(ranked.ranking.test_grasp[row].tolist())
        mark = "taken" if chosen else "as near"
        lines.append(
            f"layer {at[0]}, y {at[1]}, x {at[2]}, orientation {o}: {said} ({mark})"
        )
    more = len(lines) - LISTED_TIES
    return lines[:LISTED_TIES] + ([f"… and {more} more"] if more > 0 else [])
