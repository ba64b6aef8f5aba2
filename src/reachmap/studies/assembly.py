"""From the payloads of variants to the study, for resumable runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.maps.comparison.significance import benjamini_hochberg
from reachmap.maps.records import RunInfo, Stamp, Status
from reachmap.maps.study.format import write_study
from reachmap.maps.study.record import (
    LOWER_IS_BETTER,
    BinSquares,
    Study,
    VariantStatus,
)
from reachmap.runtime.job import Job, Kind, Stages, Work
from reachmap.scans.document import journal_settings, provenance_from_document
from reachmap.studies.outcomes import (
    Change,
    Outcomes,
    Requirement,
    compare_outcomes,
    is_met,
)

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

VALUES = ("value", "low", "high")


def failure(cause: str) -> dict[str, Any]:
    """Payload of a variant that cannot be computed."""
    return {"cause": cause, "sha256": {}, "outcomes": {}}


def left_out(cause: str) -> dict[str, Any]:
    """Payload of a variant that coarse maps have ruled out."""
    return failure(cause) | {"left_out": True}


def blank(document: Mapping[str, Any], unit: int, status: Status) -> dict[str, Any]:
    """Payload of a variant that was not computed, or broke."""
    return failure("it broke" if status == Status.ERROR else "")


def tally(payload: Mapping[str, Any]) -> tuple[int, int]:
    """Variants that were computed, of one."""
    return int(not payload["cause"]), 1


def assemble(
    document: Mapping[str, Any], payloads: Sequence[Any], *, run: RunInfo
) -> Study:
    """Make the study; units are variants that differ, rows are all of them.

    Of variants that were proposed one after the other, each payload tells its row.
    """
    names = tuple(document["objectives"])
    rows, found = _rows(document, payloads)
    outcomes = [
        {name: Outcomes(**value) for name, value in payload["outcomes"].items()}
        for payload in found
    ]
    values = _values(outcomes, names)
    changes = _changes(outcomes, names, document["base"])
    requirements = [Requirement(**item) for item in document["requirements"]]
    done = np.array([bool(payload["outcomes"]) for payload in found])
    feasible = done & np.array(
        [
            is_met(requirements, dict(zip(names, row, strict=True)))
            for row in values["value"].tolist()
        ]
    )
    signs = [1.0 if name in LOWER_IS_BETTER else -1.0 for name in names]
    costs = np.where(feasible[:, None], signs * values["value"], np.nan)
    best, runner_up = best_rows(costs, document["base"])
    return Study(
        design=document["design"],
        bin_mode=document["bin_mode"],
        base=document["base"],
        parameter_names=tuple(document["parameter_names"]),
        parameter_units=tuple(document["parameter_units"]),
        objective_names=names,
        requirements=tuple(str(item) for item in requirements),
        best=best,
        runner_up=runner_up,
        parameter=np.array([row["values"] for row in rows], float),
        assignment=tuple(row["assignment"] for row in rows),
        status=_status(found, done),
        cause=tuple(payload["cause"] for payload in found),
        feasible=feasible.astype(np.uint8),
        cell_sha256=tuple(row["cell_sha256"] for row in rows),
        workspace_sha256=_hashes(found, "workspace"),
        placement_sha256=_hashes(found, "placement"),
        bin_sha256=_hashes(found, "bin"),
        objective=values["value"],
        objective_low=values["low"],
        objective_high=values["high"],
        **changes,
        squares=squares_of([row.get("bin_reachability") for row in outcomes]),
        stamp=Stamp(**document["stamp"]),
        provenance=provenance_from_document(document),
        run=run,
    )


def _rows(
    document: Mapping[str, Any], payloads: Sequence[Any]
) -> tuple[Sequence[Any], list[Any]]:
    """Rows of the study in order, and the payload that each takes its numbers from."""
    if "rows" not in document:
        nothing = {
            "values": [np.nan] * len(document["parameter_names"]),
            "assignment": "",
            "cell_sha256": "",
        }
        return [payload.get("row", nothing) for payload in payloads], [*payloads]
    rows = document["rows"]
    return rows, [
        failure(row["cause"]) if row["unit"] is None else payloads[row["unit"]]
        for row in rows
    ]


def _hashes(found: Sequence[Mapping[str, Any]], name: str) -> tuple[str, ...]:
    return tuple(payload["sha256"].get(name, "") for payload in found)


def _status(found: Sequence[Mapping[str, Any]], done: BoolArray) -> Any:
    failed = np.array([bool(payload["cause"]) for payload in found])
    status = np.where(failed, VariantStatus.FAILED, VariantStatus.NOT_ATTEMPTED)
    left = np.array([payload.get("left_out", False) for payload in found])
    status = np.where(left, VariantStatus.LEFT_OUT, status)
    return np.where(done & ~failed, VariantStatus.DONE, status).astype(np.uint8)


def squares_of(outcomes: Sequence[Outcomes | None]) -> BinSquares | None:
    """What is reached at each point; None where variants have other points."""
    tables = [None if found is None else found.by_point() for found in outcomes]
    first = next((table for table in tables if table is not None), None)
    if first is None or not all(
        np.array_equal(table[0], first[0]) and np.array_equal(table[1], first[1])
        for table in tables
        if table is not None
    ):
        return None
    nothing = np.full_like(first[2], np.nan)
    return BinSquares(
        bin_x=first[0],
        bin_y=first[1],
        bin_square=np.array([nothing if t is None else t[2] for t in tables]),
    )


def _values(
    outcomes: Sequence[Mapping[str, Outcomes]], names: Sequence[str]
) -> dict[str, FloatArray]:
    return {
        field: np.array(
            [
                [getattr(row[name], field) if name in row else np.nan for name in names]
                for row in outcomes
            ],
            float,
        ).reshape(len(outcomes), len(names))
        for field in VALUES
    }


def _changes(
    outcomes: Sequence[Mapping[str, Outcomes]], names: Sequence[str], base: int
) -> dict[str, Any]:
    """Every variant against the base, and which changes are significant among all."""
    nothing = Change()
    table = [
        [
            compare_outcomes(name, outcomes[base][name], row[name])
            if k != base and name in row and name in outcomes[base]
            else nothing
            for name in names
        ]
        for k, row in enumerate(outcomes)
    ]
    arrays = {
        item.name: np.array([[getattr(c, item.name) for c in row] for row in table])
        for item in dataclasses.fields(Change)
    }
    p_value = arrays["p_value"]
    tested = ~np.isnan(p_value)
    significant = np.zeros(p_value.shape, np.uint8)
    significant[tested] = benjamini_hochberg(p_value[tested])
    return {**arrays, "significant": significant}


def best_rows(costs: FloatArray, base: int) -> tuple[int, int]:
    """The cheapest variant and the one after it, -1 for none.

    Of those that are equal by the first cost the base comes first: what gains nothing
    is no reason to change. Of others the next cost decides.

    Parameters
    ----------
    costs : array, shape (variants, objectives)
        Variants whose first cost is NaN cannot be chosen.
    base : int
    """
    rows = np.flatnonzero(~np.isnan(costs[:, 0]))
    first, *others = costs[rows].T
    order = rows[np.lexsort((rows, *reversed(others), rows != base, first))]
    best, runner_up = [*order.tolist(), -1, -1][:2]
    return best, runner_up


KIND = Kind(name="study", blank=blank, assemble=assemble, write=write_study)


def work_on_cells(
    cells: Sequence[LoadedCell],
    units: Sequence[Any],
    job: Callable[[Stages], Job],
    document: dict[str, Any],
) -> Work:
    """Work of a study with a fixed list of cells, one unit each."""
    return Work(
        kind=KIND,
        units=units,
        job=job,
        settings=journal_settings(document)
        | {"cells": [loaded.sha256 for loaded in cells]},
        document=document,
        frames=len(units),
    )
