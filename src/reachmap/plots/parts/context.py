"""The cell behind an artefact, as far as a picture needs it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from reachmap._typing import FloatArray
from reachmap.cell.model.cell import Cell
from reachmap.errors import SettingsError
from reachmap.geometry import inverse_transform
from reachmap.maps.records import Provenance, WorkspaceMap
from reachmap.maps.summary.upright import upright_workspace
from reachmap.plots.parts.outlines import (
    Outline,
    base_outline,
    bin_outlines,
    body_outlines,
)
from reachmap.plots.parts.squares import cell_edges


@dataclass(frozen=True, slots=True, kw_only=True)
class CellContext:
    """Name and outlines of a cell; empty for an artefact without a readable cell.

    Attributes
    ----------
    cell : Cell or None
    name : str
    standing : tuple of Outline
        Robot base and bodies that stand still.
    bin : tuple of Outline
        The bin where the cell puts it.
    """

    cell: Cell | None = None
    name: str = ""
    standing: tuple[Outline, ...] = ()
    bin: tuple[Outline, ...] = ()

    @property
    def bin_name(self) -> str:
        """Name of the cell, and of the bin where it stands beside others."""
        if self.cell is None or not self.cell.bins:
            return self.name
        return f"{self.name}, bin {self.cell.bin.name}"


def context_of(provenance: Provenance) -> CellContext:
    """Read the resolved cell of an artefact.

    A picture of the numbers is better than none, so a cell that this version cannot
    read gives an empty context.
    """
    try:
        cell = Cell.model_validate_json(provenance.cell_resolved_json)
    except ValidationError:
        return CellContext()
    return CellContext(
        cell=cell,
        name=cell.name,
        standing=(base_outline(cell, provenance.urdf), *body_outlines(cell)),
        bin=bin_outlines(
            cell.bin, inverse_transform(cell.T_base_level()) @ cell.T_base_bin()
        ),
    )


def levels_of(workspace: WorkspaceMap) -> WorkspaceMap:
    """A map as pictures show it: its levels rise, its outlines are seen from above.

    A lattice that leans is shown as it is.
    """
    cell = context_of(workspace.provenance).cell
    if cell is None:
        return workspace
    try:
        return upright_workspace(workspace, cell.T_base_level())
    except SettingsError:
        return workspace


def patch_shape(
    outlines: tuple[Outline, ...], x: FloatArray, y: FloatArray
) -> tuple[int, int]:
    """Rows and columns of squares nearest to a bin's size, odd: one is the middle.

    Parameters
    ----------
    outlines : tuple of Outline
        Of the bin; the smallest is its inner bottom. Without any, 3×3.
    x, y : array, shape (nx,), (ny,)
        Centres of the squares [m].
    """
    if not outlines:
        return 3, 3
    sides = np.array([np.ptp(o.polygon, axis=0) for o in outlines]).min(axis=0)
    steps = [float(np.diff(cell_edges(c)).min()) for c in (x, y)]
    columns, rows = (
        1 + 2 * max(0, round((side / step - 1.0) / 2.0))
        for side, step in zip(sides, steps, strict=True)
    )
    return rows, columns
