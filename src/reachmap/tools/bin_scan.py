"""``bin-scan``: from a placed bin to a bin map."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap.cell.loading import read_cell
from reachmap.core.scene import Scene
from reachmap.disk import as_path
from reachmap.errors import SettingsError
from reachmap.maps import (
    BinMap,
    Status,
    artefact_kind,
    read_placement,
    read_workspace_map,
)
from reachmap.maps.base.format import read_base
from reachmap.maps.cycle.summary import summarise_cycle
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.summary.bin import clearance_shares
from reachmap.runtime.job import Work
from reachmap.runtime.options import IN_PROCESS, RunOptions
from reachmap.runtime.run import run_scan
from reachmap.sampling.frames import approach_distance_m
from reachmap.scans.bin_roadmap import grasp_grid, roadmap_of
from reachmap.scans.bin_scan import bin_work, pairs_of_fillings, plan_grasps
from reachmap.scans.cycle.cell_checks import drop_off_warnings, require_room_for_part
from reachmap.scans.cycle.scenes import CycleScenes, stages_of
from reachmap.scans.document import checking_settings, scan_document
from reachmap.scans.ik_survey import survey_frames
from reachmap.tools.prologue import (
    check_scan_output,
    path_of_cell,
    refuse_cell_files,
    shards_of,
    warn_of_nothing,
    with_seed,
)

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

# A choice: an estimate within seconds; planning to a grasp varies.
SAMPLE_GRASPS = 20

logger = logging.getLogger(__name__)


def bin_scan(
    placement: str | Path | None,
    output: str | Path,
    *,
    cell: str | Path | None = None,
    workspace: str | Path | None = None,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    run: RunOptions = IN_PROCESS,
) -> BinMap | None:
    """Plan to every test grasp inside the bin, ``repeats`` times.

    Parameters
    ----------
    placement : Path or None
        Artefact of place-bin or place-robot, which holds the cell with its bin pose
        and scan configuration. None takes the bin where the cell has it.
    output : Path
        The artefact to write.
    cell : str, optional
        Instead of a placement: shipped name or path; ``ur5-eye-in-hand`` where neither
        of them nor a workspace is given.
    workspace : Path, optional
        Artefact of workspace-scan: without a placement and a cell, its cell is taken.
    overrides : sequence of str
        ``key.path=value``.
    seed : int, optional
    run : RunOptions

    Returns
    -------
    BinMap or None
        What was written; None for a shard, whose journal waits to be merged.

    Raises
    ------
    ReachmapError
        See :mod:`reachmap.errors`.
    """
    output = Path(output)
    placement, workspace = as_path(placement), as_path(workspace)
    cell = None if cell is None else str(cell)
    check_scan_output(output, run, [placement, workspace, path_of_cell(cell)])
    loaded, source = load_placed_cell(
        placement, cell, with_seed(overrides, seed), workspace
    )
    refuse_cell_files([output], loaded)
    work = bin_scan_work(loaded, source)
    outcome = run_scan(work, output=output, options=run, label="bin-scan")
    warn_of_nothing(outcome.artefact, output)
    return outcome.artefact  # type: ignore[no-any-return]


def bin_scan_work(loaded: LoadedCell, source_sha256: str = "") -> Work:
    """Work of a bin scan.

    Parameters
    ----------
    loaded : LoadedCell
    source_sha256 : str
        Content hash of the artefact that the cell is from, "" for none.

    Raises
    ------
    SceneError
        The cell cannot work.
    """
    scene = Scene.shared(loaded, with_bin=True)
    scene.require_free_scan_configuration()
    scenes = CycleScenes.of(loaded)
    if scenes is not None:
        scenes.home()
        require_room_for_part(scenes)
        for warning in drop_off_warnings(scenes):
            logger.warning(warning)
    document = scan_document(
        scene,
        body_pairs=pairs_of_fillings(loaded),
        kind="bin_map",
        method="planned",
        settings=_settings(scene),
        source_sha256=source_sha256,
    )
    return bin_work(scene, document)


def load_placed_cell(
    placement: Path | None,
    cell: str | None,
    overrides: Sequence[str],
    workspace: Path | None = None,
) -> tuple[LoadedCell, str]:
    """Cell to scan, and the content hash of the artefact it is from ("" for none)."""
    if placement is not None and cell is not None:
        raise SettingsError(f"{placement} holds a cell; give either it or {cell}")
    if cell is not None or (placement is None and workspace is None):
        return read_cell("ur5-eye-in-hand" if cell is None else cell, overrides), ""
    if placement is not None:
        placed = (
            read_base(placement)
            if artefact_kind(placement) == "base_placement"
            else read_placement(placement)
        )
        loaded = cell_of_artefact(placed.provenance, str(placement), overrides)
        return loaded, placed.stamp.content_sha256
    assert workspace is not None
    mapped = read_workspace_map(workspace)
    loaded = cell_of_artefact(mapped.provenance, str(workspace), overrides)
    return loaded, mapped.stamp.content_sha256


def summary_of_bin(bin_map: BinMap | None) -> dict[str, Any]:
    """Headline of a map: grasps, reachability, and its share with more clearance."""
    if bin_map is None:
        return {}
    reachable = bin_map.status == Status.PATH_FOUND
    first = bin_map.path_found[..., 0] > 0
    kept = {
        f"path_reachability_at_{1000 * share.clearance_m:.0f}_mm_clearance_percent": (
            round(share.frames, 2)
        )
        for share in clearance_shares(bin_map)
    }
    return {
        "test_grasps": reachable.size,
        "plans": bin_map.path_found.size,
        "reachable_after_1_attempt_percent": round(100 * float(first.mean()), 2),
        "path_reachability_percent": round(100 * float(reachable.mean()), 2),
        **kept,
        **_summary_of_cycles(bin_map),
    }


def _summary_of_cycles(bin_map: BinMap) -> dict[str, Any]:
    cycle = summarise_cycle(bin_map)
    if cycle is None:
        return {}
    made = cycle.throughput
    return {
        "whole_cycles_percent": round(cycle.reachability, 2),
        "cycle_time_s": None if made is None else round(cycle.seconds, 2),
        "picks_per_hour": None if made is None else round(made.picks_per_hour),
    }


def estimate_bin_scan(
    placement: Path | None,
    *,
    cell: str | None,
    workspace: Path | None = None,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    run: RunOptions = IN_PROCESS,
) -> dict[str, Any]:
    """Estimate what a scan would do, timed on a few test grasps; write nothing."""
    loaded, _ = load_placed_cell(placement, cell, with_seed(overrides, seed), workspace)
    scene = Scene.shared(loaded, with_bin=True)
    scene.require_free_scan_configuration()
    grid, fillings = grasp_grid(scene), loaded.fillings()
    if len(fillings) > 1:  # the middle one stands for all
        scene = Scene.shared(fillings[len(fillings) // 2], with_bin=True)
    rows = np.random.default_rng(0).permutation(grid.size)[:SAMPLE_GRASPS]
    begin = time.perf_counter()
    survey = survey_frames(
        scene, grid.transforms_at(rows), approach_distance_m(loaded.cell)
    )
    plan_grasps(scene, roadmap_of(scene, survey), range(len(rows)))
    seconds = (time.perf_counter() - begin) / len(rows) * grid.size
    return {
        "cell": loaded.cell.name,
        "test_grasps": grid.size,
        "plans": grid.size * loaded.cell.bin_scan.repeats,
        "estimated_s": round(seconds / run.workers / shards_of(run), 1),
    }


def _settings(scene: Scene) -> dict[str, Any]:
    cell, stages = scene.loaded.cell, stages_of(scene.loaded)
    return {
        **checking_settings(scene),
        "planner": cell.planner.model_dump(mode="json"),
        "roadmap": cell.roadmap.model_dump(mode="json"),
        "tool": cell.tool.model_dump(mode="json"),
        "attempts": cell.bin_scan.attempts,
        "repeats": cell.bin_scan.repeats,
        "fill_m": list(cell.bin_scan.layers) if cell.bin_scan.is_filled else None,
        "press_in_m": cell.bin_scan.press_in_m if cell.bin_scan.is_filled else None,
        "approach_distance_m": approach_distance_m(cell),
        **({"cycle_stages": list(stages)} if stages else {}),
    }
