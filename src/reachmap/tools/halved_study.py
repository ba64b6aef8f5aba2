"""Work of a study that leaves out poor variants after coarse maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from reachmap.cell.loading import LoadedCell
from reachmap.maps.study.record import LOWER_IS_BETTER, OBJECTIVES
from reachmap.runtime.job import Job, Stages, Work
from reachmap.studies.assembly import failure, left_out, tally, work_on_cells
from reachmap.studies.outcomes import Requirement, utility
from reachmap.tools.variant import Proposal, VariantContext, compute_proposal

# Points along each side of a grid, as a share of the cell's own: maps of a ninth, then
# of not quite half the frames. After each the better half goes on ("successive
# halving"; Jamieson and Talwalkar, "Non-stochastic best arm identification and
# hyperparameter optimization", 2016).
RUNGS = (1 / 3, 2 / 3)
# Fewer are not worth a round of their own.
FEWEST = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class _Kept:
    """What the last round needs: who is in it, and why the others are not."""

    context: VariantContext
    causes: Mapping[int, str]


def halved_work(
    cells: Sequence[LoadedCell],
    document: dict[str, Any],
    context: VariantContext,
    *,
    base: int,
    requirements: Sequence[Requirement],
) -> Work:
    """Work of a study of cells that differ, of which the poor are not mapped finely.

    Parameters
    ----------
    cells : sequence of LoadedCell
    document : dict
    context : VariantContext
    base : int
        Cell that is always kept, for the others are compared with it; -1: none.
    requirements : sequence of Requirement
    """
    return work_on_cells(
        cells,
        [(k, _as_it_is(loaded)) for k, loaded in enumerate(cells)],
        partial(_job, tuple(cells), context, base, tuple(requirements)),
        document,
    )


def _as_it_is(loaded: LoadedCell) -> Proposal:
    return Proposal(row={"cause": ""}, loaded=loaded)


def _job(
    cells: Sequence[LoadedCell],
    context: VariantContext,
    base: int,
    requirements: Sequence[Requirement],
    stages: Stages,
) -> Job:
    name = context.objectives[0]
    kept, causes = [*range(len(cells))], dict[int, str]()
    job = Job(function=compute_proposal, context=context, tally=tally)
    for number, share in enumerate(RUNGS):
        if len(kept) < FEWEST:
            break
        units = [_as_it_is(coarse(cells[k], share)) for k in kept]
        found = stages.run(f"coarse_{number + 1}", job, units)
        out = poor(kept, found, base, name, requirements)
        causes |= out
        kept = [k for k in kept if k not in out]
    return Job(
        function=_compute_kept,
        context=_Kept(context=context, causes=causes),
        tally=tally,
    )


def poor(
    kept: Sequence[int],
    found: Sequence[Mapping[str, Any]],
    base: int,
    name: str,
    requirements: Sequence[Requirement],
) -> dict[int, str]:
    """Those of the worse half that are surely below the best, and why.

    What fails on a coarse map is mapped finely: it may be the coarse map that is wrong.
    """
    scores = [utility(item, name, requirements) for item in found]
    order = sorted(range(len(kept)), key=lambda row: (-scores[row], row))
    best = found[order[0]]["outcomes"].get(name)
    if best is None:
        return {}
    sign = -1.0 if name in LOWER_IS_BETTER else 1.0
    unit = "%" if OBJECTIVES[name] == "percent" else OBJECTIVES[name]
    causes = {}
    for row in order[(len(order) + 1) // 2 :]:
        own = found[row]["outcomes"].get(name)
        if kept[row] == base or own is None:
            continue
        ends = ("high", "low") if sign > 0 else ("low", "high")
        if sign * own[ends[0]] < sign * best[ends[1]]:
            causes[kept[row]] = (
                f"left out after coarse maps: {name} {own['value']:.3g} {unit}, "
                f"the best {best['value']:.3g} {unit}"
            )
    return causes


def coarse(loaded: LoadedCell, share: float) -> LoadedCell:
    """The cell with fewer points along each side of its grids, and one attempt each."""

    def fewer(grid: tuple[int, int]) -> tuple[int, int]:
        x, y = (min(n, max(2, round(n * share))) for n in grid)
        return x, y

    cell = loaded.cell
    cubes = tuple(
        cube.model_copy(update={"grid": fewer(cube.grid)})
        for cube in cell.workspace_scan.cubes
    )
    return loaded.with_cell(
        cell.model_copy(
            update={
                "workspace_scan": cell.workspace_scan.model_copy(
                    update={"cubes": cubes}
                ),
                "bin_scan": cell.bin_scan.model_copy(
                    update={"grid": fewer(cell.bin_scan.grid), "repeats": 1}
                ),
            }
        )
    )


def _compute_kept(kept: _Kept, unit: tuple[int, Proposal]) -> dict[str, Any]:
    index, proposal = unit
    if index in kept.causes:
        return left_out(kept.causes[index])
    found = compute_proposal(kept.context, proposal)
    return {name: found[name] for name in failure("")}
