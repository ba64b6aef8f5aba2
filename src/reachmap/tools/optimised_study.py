"""Work of a study whose variants are proposed in rounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from reachmap.cell.loading import read_cell
from reachmap.cell.text.overrides import given_as
from reachmap.errors import CellError
from reachmap.runtime.job import Job, Stages, Work
from reachmap.scans.document import journal_settings
from reachmap.studies.assembly import KIND, tally
from reachmap.studies.design import Factor, Variant
from reachmap.studies.optimiser import Optimiser
from reachmap.studies.outcomes import Requirement, utility
from reachmap.tools.variant import Proposal, VariantContext, compute_proposal


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Search:
    """What is searched, and by whom.

    Attributes
    ----------
    cell : str
    overrides : tuple of str
    factors : tuple of Factor
    optimiser : Optimiser
    requirements : tuple of Requirement
    """

    cell: str
    overrides: tuple[str, ...]
    factors: tuple[Factor, ...]
    optimiser: Optimiser
    requirements: tuple[Requirement, ...]

    def proposal(self, variant: Variant) -> Proposal:
        """The variant with its cell, or why it has none."""
        row = variant.row(self.factors)
        try:
            with given_as(variant.options(self.factors)):
                loaded = read_cell(self.cell, [*self.overrides, *variant.overrides])
        except CellError as error:
            return Proposal(row=row | {"cause": "; ".join(error.lines)}, loaded=None)
        return Proposal(row=row | {"cell_sha256": loaded.sha256}, loaded=loaded)


def search_work(
    search: Search,
    document: dict[str, Any],
    objectives: tuple[str, ...],
    *,
    places_bin: bool,
) -> Work:
    """Work of a study with an optimiser; each round is a stage of its own."""
    count = search.optimiser.count
    return Work(
        kind=KIND,
        units=range(count),
        job=partial(_job, search, objectives, places_bin),
        settings=journal_settings(document),
        document=document,
        frames=count,
    )


def _job(
    search: Search, objectives: tuple[str, ...], places_bin: bool, stages: Stages
) -> Job:
    context = VariantContext(
        objectives=objectives, places_bin=places_bin, workspaces=()
    )
    job = Job(function=compute_proposal, context=context, tally=tally)
    found: list[Any] = []
    for k, variants in enumerate(search.optimiser.rounds()):
        proposals = [search.proposal(variant) for variant in variants]
        payloads = stages.run(f"round_{k}", job, proposals)
        search.optimiser.tell(
            [utility(item, objectives[0], search.requirements) for item in payloads]
        )
        found += payloads
    return Job(function=_pick, context=found, tally=tally)


def _pick(found: Sequence[Any], index: int) -> Any:
    """What the rounds have found, variant by variant."""
    return found[index]
