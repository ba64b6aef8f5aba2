"""``study``: from a cell and what to vary to a study of all variants."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from reachmap.cell.loading import LoadedCell, read_cell
from reachmap.cell.text.overrides import given_as
from reachmap.core.memo import fingerprint
from reachmap.disk import one_or_more
from reachmap.errors import CellError, GateFailedError, SceneError, SettingsError
from reachmap.maps import Stamp, collect_provenance, config_sha256
from reachmap.maps.study.record import ALWAYS, OBJECTIVES, Study, VariantStatus
from reachmap.runtime.job import Job, Stages, Work
from reachmap.runtime.options import IN_PROCESS, RunOptions
from reachmap.runtime.run import run_scan
from reachmap.studies.assembly import tally, work_on_cells
from reachmap.studies.design import (
    Factor,
    Variant,
    base_of,
    choices_of,
    factors_of,
    grid,
    latin_hypercube,
    place_of,
)
from reachmap.studies.optimiser import Optimiser
from reachmap.studies.outcomes import OPERATORS, Requirement
from reachmap.tools.halved_study import halved_work
from reachmap.tools.optimised_study import Search, search_work
from reachmap.tools.prologue import (
    check_scan_output,
    path_of_cell,
    refuse_cell_files,
    warn_of_moving,
    with_seed,
)
from reachmap.tools.variant import (
    NOT_OF_WORKSPACE,
    VariantContext,
    VariantUnit,
    compute_variant,
    map_workspace,
    needs_workspace,
    workspace_key,
)

REQUIREMENT = re.compile(
    r"\s*([a-z_]+)\s*(>=|<=|>|<)\s*([-+]?\d{1,9}(?:\.\d{0,9})?)\s*%?\s*"
)


def study(
    cell: str | Path,
    output: str | Path,
    *,
    vary: Sequence[str],
    samples: int | None = None,
    optimise: int | None = None,
    halving: bool = False,
    place: bool = False,
    objectives: Sequence[str] = (),
    require: Sequence[str] = (),
    overrides: Sequence[str] = (),
    seed: int | None = None,
    run: RunOptions = IN_PROCESS,
) -> Study:
    """Map variants of a cell, and compare each with the one closest to the cell.

    Parameters
    ----------
    cell : str
        Shipped name or path.
    output : Path
        The study to write.
    vary : sequence of str
        ``NAME=LOW:HIGH:N`` or ``NAME=a,b,c``; NAME is a parameter of the cell or a key
        as ``--set`` takes it.
    samples : int, optional
        Variants of a Latin hypercube instead of every combination.
    optimise : int, optional
        Variants that an optimiser proposes, each from what those before were worth.
    halving : bool
        Leave out variants that coarse maps show to be poor.
    place : bool
        Place the bin again in each variant.
    objectives : sequence of str
        Keys of :data:`~reachmap.maps.study.record.OBJECTIVES`; by default those that
        every cell has; the
        first says which variant is best.
    require : sequence of str
        As in ``"bin_reachability >= 90"``.
    overrides : sequence of str
        ``key.path=value``, the same in all variants.
    seed : int, optional
    run : RunOptions

    Raises
    ------
    IncompleteError
        A variant broke; the others are in the study.
    ReachmapError
        See :mod:`reachmap.errors`. A variant whose cell is wrong is a row with a
        cause, unless all are.
    """
    cell, output, vary = str(cell), Path(output), one_or_more(vary)
    if run.shard is not None:
        raise SettingsError("--shard: a study is shared out by its workers")
    requirements = tuple(_requirement(text) for text in one_or_more(require))
    names = _objective_names(one_or_more(objectives), requirements)
    check_scan_output(output, run, [path_of_cell(cell)])
    overrides = with_seed(overrides, seed)
    base = read_cell(cell, overrides)
    refuse_cell_files([output], base)
    if place:
        warn_of_moving(base)
    _check_objectives(names, base)
    factors = _factors(vary, base, samples, optimise, halving=halving)
    for change in choices_of(factors):
        with suppress(CellError):  # of that variant, which gets a row with its cause
            refuse_cell_files([output], read_cell(cell, [*overrides, change]))
    settings = {
        "vary": list(vary),
        "samples": samples,
        **({} if optimise is None else {"optimise": optimise}),
        **({"halving": True} if halving else {}),
        "bin": "placed" if place else "kept",
        "objectives": list(names),
        "require": [str(item) for item in requirements],
    }
    document = _document(base, settings) | {
        "bin_mode": settings["bin"],
        "parameter_names": [factor.name for factor in factors],
        "parameter_units": [factor.unit for factor in factors],
        "objectives": list(names),
        "requirements": [dataclasses.asdict(item) for item in requirements],
    }
    design = _Design(cell, tuple(overrides), factors, base, requirements, names, place)
    work = (
        design.work(document, samples, halving=halving)
        if optimise is None
        else design.search(document, optimise)
    )
    outcome = run_scan(work, output=output, options=run, label="study")
    result: Study = outcome.artefact
    return result


def _factors(
    vary: Sequence[str],
    base: LoadedCell,
    samples: int | None,
    optimise: int | None,
    *,
    halving: bool,
) -> tuple[Factor, ...]:
    """Read what is varied; refuse contradictory ways to choose variants."""
    if samples is not None and optimise is not None:
        raise SettingsError("give --optimise or --latin-hypercube, not both")
    if halving and optimise is not None:
        raise SettingsError(
            "--halving: not with --optimise, which leaves out poor variants itself"
        )
    factors = factors_of(
        vary, base, sampled=samples is not None, optimised=optimise is not None
    )
    if not factors:
        raise SettingsError("nothing to vary: give --vary NAME=LOW:HIGH:N")
    return factors


@dataclass(frozen=True, slots=True)
class _Design:
    """What is varied, and what for; see :func:`study`."""

    cell: str
    overrides: tuple[str, ...]
    factors: tuple[Factor, ...]
    base: LoadedCell
    requirements: tuple[Requirement, ...]
    objectives: tuple[str, ...]
    places_bin: bool

    def work(
        self, document: dict[str, Any], samples: int | None, *, halving: bool
    ) -> Work:
        """Work of a fixed list of variants."""
        variants = (
            grid(self.factors)
            if samples is None
            else latin_hypercube(self.factors, samples, self.base.cell.seed)
        )
        rows, cells = _rows(self.cell, self.overrides, self.factors, variants)
        document |= {
            "design": "grid" if samples is None else "latin_hypercube",
            "base": base_of(self.factors, variants, self.base),
            "rows": rows,
        }
        if not halving:
            return study_work(
                cells, document, self.objectives, places_bin=self.places_bin
            )
        unit = rows[document["base"]]["unit"]
        return halved_work(
            cells,
            document,
            VariantContext(
                objectives=self.objectives, places_bin=self.places_bin, workspaces=()
            ),
            base=-1 if unit is None else unit,
            requirements=self.requirements,
        )

    def search(self, document: dict[str, Any], count: int) -> Work:
        """Work of variants that an optimiser proposes, the cell as it is first."""
        first = place_of(self.factors, self.base)
        search = Search(
            cell=self.cell,
            overrides=self.overrides,
            factors=self.factors,
            optimiser=Optimiser(self.factors, count, self.base.cell.seed, first),
            requirements=self.requirements,
        )
        document |= {"design": "optimised", "base": 0}
        return search_work(
            search, document, self.objectives, places_bin=self.places_bin
        )


def _requirement(text: str) -> Requirement:
    found = REQUIREMENT.fullmatch(text)
    if found is None or found[1] not in OBJECTIVES:
        names, signs = ", ".join(OBJECTIVES), ", ".join([*OPERATORS][1:])
        raise SettingsError(
            f"--require {text!r:.80}: expected 'NAME >= NUMBER' (or {signs}) with NAME "
            f"one of {names}"
        )
    return Requirement(objective=found[1], operator=found[2], bound=float(found[3]))


def _check_objectives(names: Sequence[str], base: LoadedCell) -> None:
    """Refuse objectives that a cell's maps do not have."""
    cell = base.cell
    has_cycle = cell.held() is not None and bool(cell.drop_offs)
    for name in names:
        if name.startswith("cycle_") and not has_cycle:
            raise SettingsError(f"{name}: the cell has no part, or no drop_off")
        if name == "emptied" and len(cell.bin_scan.layers) < 2:
            raise SettingsError("emptied: bin_scan needs layers at two heights or more")


def _objective_names(
    objectives: Sequence[str], requirements: Sequence[Requirement]
) -> tuple[str, ...]:
    for name in objectives:
        if name not in OBJECTIVES:
            names = ", ".join(OBJECTIVES)
            raise SettingsError(f"--objective {name!r:.60}: expected one of {names}")
    asked = objectives or ALWAYS
    return tuple(dict.fromkeys([*asked, *(item.objective for item in requirements)]))


def _rows(
    cell: str,
    overrides: Sequence[str],
    factors: Sequence[Factor],
    variants: Sequence[Variant],
) -> tuple[list[dict[str, Any]], list[LoadedCell]]:
    """Rows of the study, and the cells that differ; wrong ones have a cause.

    Raises
    ------
    CellError
        All are wrong.
    """
    rows: list[dict[str, Any]] = []
    cells: dict[str, LoadedCell] = {}
    error: CellError | None = None
    for variant in variants:
        row = variant.row(factors)
        try:
            with given_as(variant.options(factors)):
                loaded = read_cell(cell, [*overrides, *variant.overrides])
            cells.setdefault(loaded.sha256, loaded)
            row |= {
                "unit": [*cells].index(loaded.sha256),
                "cell_sha256": loaded.sha256,
            }
        except CellError as found:
            row["cause"], error = "; ".join(found.lines), found
        rows.append(row)
    if error is not None and not cells:
        raise error
    return rows, _grouped(rows, [*cells.values()])


def _grouped(
    rows: Sequence[dict[str, Any]], cells: list[LoadedCell]
) -> list[LoadedCell]:
    """Cells in an order in which those with the same arm and tool are neighbours.

    A process takes over what it has found for such a cell, and keeps little of it.
    """
    arms = [
        fingerprint(loaded, without=NOT_OF_WORKSPACE, surroundings=False)
        for loaded in cells
    ]
    order = sorted(range(len(cells)), key=lambda k: arms.index(arms[k]))
    for row in rows:
        if row["unit"] is not None:
            row["unit"] = order.index(row["unit"])
    return [cells[k] for k in order]


def _document(base: LoadedCell, settings: dict[str, Any]) -> dict[str, Any]:
    stamp = Stamp(
        seed=base.cell.seed,
        cell_sha256=base.sha256,
        config_sha256=config_sha256(
            kind="study",
            cell_sha256=base.sha256,
            seed=base.cell.seed,
            settings=settings,
        ),
    )
    return {
        "method": "study",
        "provenance": dataclasses.asdict(collect_provenance(base, settings=settings)),
        "stamp": dataclasses.asdict(stamp),
    }


def study_work(
    cells: Sequence[LoadedCell],
    document: dict[str, Any],
    objectives: tuple[str, ...],
    *,
    places_bin: bool,
) -> Work:
    """Work of a study: one unit for each cell that differs from the others.

    Workspace maps are made first, one for all cells that differ by their bin alone.
    """
    keys = [
        workspace_key(loaded)
        if needs_workspace(objectives, places_bin=places_bin)
        else ""
        for loaded in cells
    ]
    distinct = [*dict.fromkeys(key for key in keys if key)]
    units = [
        VariantUnit(loaded=loaded, workspace=distinct.index(key) if key else -1)
        for loaded, key in zip(cells, keys, strict=True)
    ]
    firsts = [cells[keys.index(key)] for key in distinct]
    return work_on_cells(
        cells, units, partial(_job, firsts, objectives, places_bin), document
    )


def _job(
    firsts: Sequence[LoadedCell],
    objectives: tuple[str, ...],
    places_bin: bool,
    stages: Stages,
) -> Job:
    workspaces = (
        stages.run("workspaces", Job(function=map_workspace, context=None), firsts)
        if firsts
        else []
    )
    context = VariantContext(
        objectives=objectives, places_bin=places_bin, workspaces=workspaces
    )
    return Job(function=compute_variant, context=context, tally=tally)


def require_mapped(result: Study) -> None:
    """Raise SceneError if no variant could be mapped: the cell is wrong in all."""
    causes = [cause for cause in result.cause if cause]
    if causes and VariantStatus.DONE not in result.status:
        raise SceneError(f"no variant could be mapped; the first: {causes[0]}")


def require_feasible(result: Study) -> None:
    """Raise GateFailedError if requirements were made and no variant meets them."""
    if result.requirements and not result.feasible.any():
        raise GateFailedError(f"no variant meets {' and '.join(result.requirements)}")
