"""``workspace-scan``: from a cell to a workspace map."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from reachmap.cell.loading import LoadedCell, read_cell
from reachmap.cell.resolution import leaning_levels
from reachmap.core.scene import Scene
from reachmap.errors import SettingsError
from reachmap.maps import Status, WorkspaceMap
from reachmap.maps.summary.statistics import level_means
from reachmap.runtime.job import Work
from reachmap.runtime.options import IN_PROCESS, RunOptions
from reachmap.runtime.run import run_scan
from reachmap.sampling.frames import workspace_frames
from reachmap.scans.document import checking_settings, scan_document
from reachmap.scans.ik_survey import survey_frames
from reachmap.scans.workspace_per_frame import per_frame_work, plan_frames
from reachmap.scans.workspace_roadmap import connect_survey, roadmap_work
from reachmap.tools.prologue import (
    check_scan_output,
    path_of_cell,
    refuse_cell_files,
    shards_of,
    warn_of_nothing,
    with_seed,
)

logger = logging.getLogger(__name__)

METHODS = ("roadmap", "per-frame")
# A choice: an estimate within seconds; inverse kinematics is quick.
SAMPLE_FRAMES = 200


def workspace_scan(
    cell: str | Path,
    output: str | Path,
    *,
    method: str = "roadmap",
    with_bin: bool = False,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    run: RunOptions = IN_PROCESS,
) -> WorkspaceMap | None:
    """Map what the arm reaches around its base.

    Parameters
    ----------
    cell : str
        Shipped name or path.
    output : Path
        The artefact to write.
    method : {"roadmap", "per-frame"}
    with_bin : bool
        Leave the bin in the scene; it is what is to be placed, so by default it is
        absent.
    overrides : sequence of str
        ``key.path=value``.
    seed : int, optional
        Instead of the cell's.
    run : RunOptions

    Returns
    -------
    WorkspaceMap or None
        What was written; None for a shard, whose journal waits to be merged.

    Raises
    ------
    ReachmapError
        See :mod:`reachmap.errors`.
    """
    output = Path(output)
    cell = str(cell)
    _check_method(method, run)
    check_scan_output(output, run, [path_of_cell(cell)])
    loaded = read_cell(cell, with_seed(overrides, seed))
    refuse_cell_files([output], loaded)
    leaning = leaning_levels(loaded.cell)
    if leaning:
        logger.warning("%s: %s", loaded.source, leaning)
    work = workspace_work(loaded, method=method, with_bin=with_bin)
    outcome = run_scan(work, output=output, options=run, label="workspace-scan")
    warn_of_nothing(outcome.artefact, output)
    return outcome.artefact  # type: ignore[no-any-return]


def workspace_work(
    loaded: LoadedCell, *, method: str = "roadmap", with_bin: bool = False
) -> Work:
    """Work of a workspace scan.

    Raises
    ------
    SceneError
        The cell cannot work.
    """
    scene = Scene.shared(loaded, with_bin=with_bin)
    scene.require_free_scan_configuration()
    document = scan_document(
        scene, kind="workspace_map", method=method, settings=_settings(scene, method)
    )
    if method == "per-frame":
        return per_frame_work(loaded, document, with_bin=with_bin)
    return roadmap_work(scene, document)


def _check_method(method: str, run: RunOptions) -> None:
    if method not in METHODS:
        raise SettingsError(f"method {method!r}: expected {' or '.join(METHODS)}")
    if method == "roadmap" and run.shard is not None:
        raise SettingsError(
            "--shard splits the per-frame method; the roadmap method looks at all "
            "frames together (leave out --shard, or add --method per-frame)"
        )


def _settings(scene: Scene, method: str) -> dict[str, Any]:
    cell = scene.loaded.cell
    how = (
        {"roadmap": cell.roadmap.model_dump(mode="json")}
        if method == "roadmap"
        else {
            "planner": cell.planner.model_dump(mode="json"),
            "repeats": cell.workspace_scan.repeats,
        }
    )
    return {**checking_settings(scene), **how}


def summary_of_workspace(workspace: WorkspaceMap | None) -> dict[str, Any]:
    """Headline of a map: frames, best level, percentages; empty for a shard."""
    if workspace is None:
        return {}
    # Cubes of different lattices leave squares between them that have no value.
    level = level_means(workspace.path_reachability)
    best = int(np.nanargmax(level))
    status = np.concatenate([c.status.ravel() for c in workspace.cubes.values()])
    return {
        "frames": len(status),
        "path_reachable_frames": int((status == Status.PATH_FOUND).sum()),
        "best_level_m": float(workspace.z[best]),
        "best_level_percent": round(float(level[best]), 2),
        "squares_at_100_percent": int((workspace.path_reachability[best] == 100).sum()),
    }


def estimate_workspace_scan(
    cell: str,
    *,
    method: str,
    with_bin: bool = False,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    run: RunOptions = IN_PROCESS,
) -> dict[str, Any]:
    """Estimate what a scan would do, timed on a few frames; write nothing."""
    _check_method(method, run)
    loaded = read_cell(cell, with_seed(overrides, seed))
    scene = Scene.build(loaded, with_bin=with_bin)
    scene.require_free_scan_configuration()
    poses = np.concatenate(
        [
            cube.frames.transforms().reshape(-1, 4, 4)
            for cube in workspace_frames(loaded.cell)
        ]
    )
    rows = np.random.default_rng(0).permutation(len(poses))[:SAMPLE_FRAMES]
    begin = time.perf_counter()
    if method == "per-frame":
        plan_frames(scene, poses[rows], rows.tolist())
    else:
        connect_survey(scene, survey_frames(scene, poses[rows], 0.0), seed=0)
    seconds = (time.perf_counter() - begin) / len(rows) * len(poses)
    workers = run.workers * shards_of(run) if method == "per-frame" else 1
    return {
        "cell": loaded.cell.name,
        "method": method,
        "frames": len(poses),
        "estimated_s": round(seconds / workers, 1),
    }
