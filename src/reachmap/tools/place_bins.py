"""``place-bin`` for a cell with several bins, placed so that they do not overlap."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from itertools import permutations
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reachmap.cell.bins.shorthand import CHOICE
from reachmap.cell.loading import stored_cell
from reachmap.disk import as_path, is_folder
from reachmap.errors import OutputError, SceneError, SettingsError
from reachmap.maps import (
    BinPlacement,
    WorkspaceMap,
    check_outputs,
    read_workspace_map,
    write_placement,
)
from reachmap.maps.bytes.publish import check_picture
from reachmap.maps.provenance import cell_of_artefact
from reachmap.runtime.options import IN_PROCESS, RunOptions
from reachmap.tools.place_bin import PlacedBin, PlacementChoice, placed_bin
from reachmap.tools.placement_picture import draw_placed
from reachmap.tools.prologue import refuse_cell_files, warn_of_moving, with_seed

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.cell.model.cell import BinSpec

# All orders of up to this many bins are tried; of more, each bin comes first once.
ALL_ORDERS = 3


def bin_names(workspace: Path) -> tuple[str, ...]:
    """Names of the bins of a workspace map's cell, () where it has a single one.

    Raises
    ------
    MapFileError, CellError
    """
    provenance = read_workspace_map(workspace).provenance
    cell = stored_cell(provenance.cell_resolved_json, source=str(workspace)).cell
    return () if cell.bin.name is None else (cell.bin.name, *cell.bins)


def named_output(path: Path, name: str) -> Path:
    """File of one of several bins: ``placement-left.h5`` for ``placement.h5``."""
    return path.with_name(f"{path.stem}-{name}{path.suffix}")


def place_bins(
    workspace: str | Path,
    output: str | Path,
    *,
    choice: PlacementChoice | None = None,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    picture: str | Path | None = None,
    run: RunOptions = IN_PROCESS,
) -> dict[str, BinPlacement]:
    """Choose a place for each of several bins.

    They are placed one after the other, each beside those that stand already, in
    every order; the order whose worst-served bin is served best is kept. All stand in
    the cell that each placement holds.

    Parameters
    ----------
    workspace : Path
        Artefact of workspace-scan, which holds the cell.
    output : Path
        Each placement is written beside it, see :func:`named_output`.
    choice, overrides, seed, picture, run
        As for :func:`reachmap.tools.place_bin.place_bin`; a pose cannot be given.

    Returns
    -------
    dict
        Name of each bin to its placement.

    Raises
    ------
    ReachmapError
        See :mod:`reachmap.errors`; the bin is named.
    """
    workspace, output, picture = Path(workspace), Path(output), as_path(picture)
    choice = choice or PlacementChoice()
    names = bin_names(workspace)
    if choice.bin_pose is not None:
        raise SettingsError("--bin-pose is for one bin: name it (--bin NAME)")
    for change in overrides:
        if change.partition("=")[0].strip() == CHOICE:
            raise SettingsError(
                f"--set {change:.120}: every bin is placed; --bin NAME places one"
            )
    if is_folder(output):
        raise OutputError(f"{output}: is a folder; name a file")
    files = {name: named_output(output, name) for name in names}
    pictures = {
        name: None if picture is None else named_output(picture, name) for name in names
    }
    check_picture(picture, "--picture")
    check_outputs(
        [*files.values(), *pictures.values()],
        overwrite=run.overwrite,
        inputs=[workspace],
    )
    workspace_map = read_workspace_map(workspace)
    cells = {
        name: cell_of_artefact(
            workspace_map.provenance,
            str(workspace),
            (*with_seed(overrides, seed), f"pick_from={name}"),
        )
        for name in names
    }
    refuse_cell_files([*files.values(), *pictures.values()], *cells.values())
    for loaded in cells.values():
        warn_of_moving(loaded)
    found = _best_order(cells, workspace_map, choice, run)
    for name in names:
        write_placement(files[name], found[name].placement, overwrite=run.overwrite)
        if (path := pictures[name]) is not None:
            draw_placed(path, found[name], run)
    return {name: found[name].placement for name in names}


def _best_order(
    cells: Mapping[str, LoadedCell],
    workspace_map: WorkspaceMap,
    choice: PlacementChoice,
    run: RunOptions,
) -> dict[str, PlacedBin]:
    best: dict[str, PlacedBin] = {}
    error: SceneError | None = None
    for order in _orders(tuple(cells)):
        least = _worst(best) if best else -1.0
        try:
            found, alone = _in_order(order, cells, workspace_map, choice, run, least)
        except SceneError as reason:
            error = reason
            continue
        if not found:
            continue
        if _worst(found) > least:
            best = found
        # The first bin had every place to choose from: no order serves it better.
        if _worst(found) >= alone:
            break
    if not best:
        assert error is not None
        raise error
    return best


def _orders(names: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    if len(names) <= ALL_ORDERS:
        yield from permutations(names)
        return
    for k in range(len(names)):
        yield names[k:] + names[:k]


def _in_order(
    order: tuple[str, ...],
    cells: Mapping[str, LoadedCell],
    workspace_map: WorkspaceMap,
    choice: PlacementChoice,
    run: RunOptions,
    least: float,
) -> tuple[dict[str, PlacedBin], float]:
    """Placements of all bins, and the worst case of the first while it was alone.

    No placements where a bin has a worst case of no more than ``least``: others that
    are put beside it will not raise it.
    """
    standing: dict[str, BinSpec] = {}
    found: dict[str, PlacedBin] = {}
    for name in order:
        found[name] = _placed(name, cells[name], standing, workspace_map, choice, run)
        placement = found[name].placement
        moved = cells[name].with_changes(bin_pose=placement.bin_pose)
        standing[name] = moved.cell.bin.model_copy(update={"name": None})
        if _worst({name: found[name]}) <= least:
            return {}, least
    alone = _worst({order[0]: found[order[0]]})
    # What the others take away from those that stood before them.
    for name in order[:-1]:
        x, y, z, yaw = (
            found[name].placement.candidate_pose[found[name].placement.chosen].tolist()
        )
        given = dataclasses.replace(
            choice, bin_pose=(x, y, z, float(np.degrees(yaw))), rule="search"
        )
        others = {other: spec for other, spec in standing.items() if other != name}
        found[name] = _placed(name, cells[name], others, workspace_map, given, run)
    return found, alone


def _placed(
    name: str,
    loaded: LoadedCell,
    others: Mapping[str, BinSpec],
    workspace_map: WorkspaceMap,
    choice: PlacementChoice,
    run: RunOptions,
) -> PlacedBin:
    try:
        beside = loaded.with_other_bins(others)
        return placed_bin(beside, workspace_map, choice, run)
    except SceneError as error:
        raise SceneError(f"bin {name}: {line}" for line in error.lines) from None


def _worst(found: Mapping[str, PlacedBin]) -> float:
    """Worst case of the bin with the lowest score [percent]."""
    scores = []
    for placed in found.values():
        placement = placed.placement
        worst = placement.worst_score
        value = placement.score if worst is None else worst
        score = float(value[placement.chosen])
        scores.append(
            float(placement.score[placement.chosen]) if np.isnan(score) else score
        )
    return min(scores)
