"""The ranked grasp list: the same document, re-ordered, each grasp with its reason.

It is written to one file or a folder, never over the supplied list.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.disk import is_folder
from reachmap.errors import SettingsError
from reachmap.maps.bytes.publish import make_folder, publish
from reachmap.ranking.lists.arrays import GraspList
from reachmap.ranking.lists.reading import STDIN
from reachmap.ranking.lookup.costs import (
    INVALID,
    LIKENESS,
    OUTSIDE_MAP,
    Ranking,
    status_name,
)
from reachmap.ranking.lookup.matching import Queries
from reachmap.ranking.lookup.settings import MARGINS, RankSettings
from reachmap.ranking.lookup.table import TERMS

TERM_NAMES = (*TERMS, LIKENESS, *MARGINS)


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


QUADRANT_ORDER = ("NW", "NE", "SW", "SE", None)


def cost_groups(
    ranked: Sequence[RankedList],
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Terms of J of each quadrant, or of each list that names none.

    Returns
    -------
    dict
        From label to the terms in supplied order and in ranked order, shape (n, k);
        a row of NaN is an unreachable grasp.
    """
    groups = {}
    for one in ranked:
        terms = np.stack([*one.terms().values()], axis=1)
        for label, rows in _rows(one, several=len(ranked) > 1).items():
            order = one.ranking.order
            best_first = order[np.isin(order, rows)]
            groups[label] = (terms[rows], terms[best_first])
    return groups


def _rows(one: RankedList, *, several: bool) -> dict[str, list[int]]:
    """Rows of each quadrant; of the whole list if it names none."""
    name = Path(one.grasps.source).stem if several else ""
    quadrants = one.grasps.quadrants
    if not any(quadrants):
        return {name or "all": list(range(len(quadrants)))} if quadrants else {}
    return {
        f"{name} {quadrant or 'other'}".strip(): rows
        for quadrant in QUADRANT_ORDER
        if (rows := [row for row, own in enumerate(quadrants) if own == quadrant])
    }


def targets_of(sources: Sequence[str | Path], output: Path | None) -> list[Path]:
    """Name the file of each list, or the one file of all.

    Parameters
    ----------
    sources : sequence of path
        The supplied lists.
    output : Path or None
        A folder takes ``NAME.ranked.json`` for each list; of several lists, a name
        without suffix is a folder that is made. Any other name is one file.

    Raises
    ------
    OutputError, SettingsError
        The folder cannot be made, or two lists have the same name.
    """
    if output is None:
        return []
    if not is_folder(output) and (len(sources) == 1 or output.suffix):
        return [output]
    targets = [output / _ranked_name(source) for source in sources]
    if len(set(targets)) < len(targets):
        raise SettingsError(
            "two lists have the same name; rank them one after the other"
        )
    make_folder(output)
    return targets


def _ranked_name(source: str | Path) -> str:
    stem = "stdin" if str(source) == STDIN else Path(source).stem
    return f"{stem.removesuffix('.ranked')}.ranked.json"


def write_lists(
    targets: Sequence[Path], texts: Sequence[str], *, overwrite: bool
) -> None:
    """Write each list to its file, or all to the one file there is."""
    contents = texts if len(targets) == len(texts) else [joined(texts)]
    for target, text in zip(targets, contents, strict=False):
        publish(target, [text.encode("ascii")], overwrite=overwrite)


def joined(texts: Sequence[str]) -> str:
    """Return one JSON value: a document, or a list of several."""
    return texts[0] if len(texts) == 1 else f"[{','.join(texts)}]\n"
