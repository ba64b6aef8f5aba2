"""``robust``: from a bin map and errors to what stays reachable."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from reachmap._typing import BoolArray, CodeArray, IntArray
from reachmap.core.collision.misplacement import Misplacement
from reachmap.disk import as_path
from reachmap.errors import SettingsError
from reachmap.maps import (
    BinMap,
    RunClock,
    RunInfo,
    Stamp,
    check_outputs,
    config_sha256,
    read_bin_map,
)
from reachmap.maps.bytes.publish import check_picture
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.robustness.format import write_robustness
from reachmap.maps.robustness.record import Certificate, Robustness
from reachmap.motions.motion import best_rows
from reachmap.robustness.errors import SOURCES, Errors, ErrorSize, unit_errors
from reachmap.robustness.problem import RobustnessProblem, certificates, replayed
from reachmap.runtime.options import IN_PROCESS, RunOptions
from reachmap.tools.prologue import refuse_cell_files

# Choices: errors in parts of the stated ones, cells drawn for each, and errors beyond
# which a cell is another cell.
SCALES = np.array([0.0, 0.25, 0.5, 1.0, 1.5, 2.0])
DEFAULT_SAMPLES, MAX_SAMPLES = 24, 10_000
MAX_SHIFT_M, MAX_TURN_RAD = 0.5, np.radians(45.0)


def robust(
    map_path: str | Path,
    output: str | Path,
    *,
    errors: Errors,
    samples: int = DEFAULT_SAMPLES,
    margin_m: float = 0.0,
    seed: int | None = None,
    picture: str | Path | None = None,
    run: RunOptions = IN_PROCESS,
) -> Robustness:
    """Find which test grasps stay reachable despite errors of bin, camera and tool.

    Parameters
    ----------
    map_path : Path
        A bin map; its best paths are run as they are stored.
    output : Path
        The artefact to write.
    errors : Errors
        Multiples of them, up to twice, are looked at.
    samples : int
        Perturbed cells at each multiple, in which paths are replayed that are not
        proved to stay free.
    margin_m : float
        Clearance that a path must keep there, at most the map's safety margin.
    seed : int, optional
        Of the perturbed cells; default: the map's.
    picture : Path, optional
        Also draw the curve there (.png or .svg).
    run : RunOptions
        Its shard and restart do not apply.

    Raises
    ------
    ReachmapError
        See :mod:`reachmap.errors`.
    """
    map_path, output, picture = Path(map_path), Path(output), as_path(picture)
    _check(errors, samples, margin_m)
    check_picture(picture, "--picture")
    check_outputs([output, picture], overwrite=run.overwrite, inputs=[map_path])
    clock = RunClock(workers=run.workers)
    bin_map = read_bin_map(map_path)
    loaded = cell_of_artefact(bin_map.provenance, str(map_path))
    refuse_cell_files([output, picture], loaded)
    rows = best_rows(bin_map)
    if not rows:
        raise SettingsError(f"{map_path}: no test grasp has a path")
    seed = bin_map.stamp.seed if seed is None else seed
    kept_m = loaded.cell.collision.safety_margin_m
    if margin_m > kept_m:
        raise SettingsError(
            f"--margin {1e3 * margin_m:g} mm: the paths of {map_path} keep "
            f"{1e3 * kept_m:g} mm (collision.safety_margin_m)"
        )
    problem = RobustnessProblem.of_map(bin_map, loaded, rows, errors, margin_m)
    with clock.phase("certify"):
        certificate, closest = certificates(problem, SCALES, run)
    with clock.phase("replay"):
        unit = unit_errors(samples, seed)
        free, cells = replayed(problem, certificate, SCALES, unit, run)
    record = _record(
        bin_map, problem, certificate, closest, free, cells, seed, clock.finish()
    )
    write_robustness(output, record, overwrite=run.overwrite)
    if picture is not None:
        _draw(picture, record, run)
    return record


def _check(errors: Errors, samples: int, margin_m: float) -> None:
    sizes = np.array([dataclasses.astuple(size) for size in _sizes(errors)])
    if not sizes.any():
        raise SettingsError(
            "give an error: --bin 5mm 1deg, --camera 1mm 0.1deg or --tool 2mm"
        )
    wrong = ((sizes < 0) | (sizes > [MAX_SHIFT_M, MAX_TURN_RAD])).any(axis=1)
    if wrong.any():
        name = f"--{SOURCES[int(np.argmax(wrong))]}"
        raise SettingsError(f"{name}: errors must be 0 to 500 mm and 0 to 45 deg")
    if not 2 <= samples <= MAX_SAMPLES:
        raise SettingsError(f"--samples must be 2 to {MAX_SAMPLES} (got {samples})")
    if margin_m < 0:
        raise SettingsError(
            f"--margin must not be negative (got {1e3 * margin_m:g} mm)"
        )


def _sizes(errors: Errors) -> tuple[ErrorSize, ...]:
    return errors.bin, errors.camera, errors.tool


def _record(
    bin_map: BinMap,
    problem: RobustnessProblem,
    certificate: CodeArray,
    closest: IntArray,
    free: BoolArray,
    cells: list[list[Misplacement]],
    seed: int,
    run: RunInfo,
) -> Robustness:
    shape, steps, samples = bin_map.status.shape, len(SCALES), free.shape[1]
    here = np.ravel_multi_index(problem.place, shape)
    size = bin_map.status.size
    reached, pairs = np.zeros(size, np.uint8), np.full(size, -1, np.int64)
    codes, kept = np.zeros((steps, size), np.uint8), np.zeros((steps, size), np.int64)
    reached[here], pairs[here] = 1, closest
    codes[:, here], kept[:, here] = certificate, free.sum(axis=1)
    settings = {
        "errors": dataclasses.asdict(problem.errors),
        "scales": SCALES.tolist(),
        "samples": samples,
        "margin_m": problem.replay.margin_m,
    }
    cell_sha256 = bin_map.stamp.cell_sha256
    return Robustness(
        scale=SCALES,
        layer=bin_map.layer,
        y=bin_map.y,
        x=bin_map.x,
        sizes=np.array([dataclasses.astuple(s) for s in _sizes(problem.errors)]),
        margin_m=problem.replay.margin_m,
        reached=reached.reshape(shape),
        certificate=codes.reshape(steps, *shape),
        kept=kept.reshape(steps, *shape),
        closest_pair=pairs.reshape(shape),
        bin_pose=np.array([[one.T_base_bin for one in row] for row in cells]),
        tool_pose=np.array([[one.T_mount_tool for one in row] for row in cells]),
        reachability=100.0 * free.sum(axis=2) / size,
        certified=100.0 * (certificate != Certificate.NONE).sum(axis=1) / size,
        body_pairs=bin_map.body_pairs,
        stamp=Stamp(
            seed=seed,
            cell_sha256=cell_sha256,
            config_sha256=config_sha256(
                kind="robustness", cell_sha256=cell_sha256, seed=seed, settings=settings
            ),
        ),
        provenance=dataclasses.replace(
            bin_map.provenance,
            settings=settings,
            source_sha256=bin_map.stamp.content_sha256,
        ),
        run=run,
    )


def _draw(path: Path, record: Robustness, run: RunOptions) -> None:
    from reachmap.plots.albums import robustness_album
    from reachmap.plots.parts.files import write_only_picture

    write_only_picture(
        path,
        robustness_album(record),
        config_sha256=record.stamp.config_sha256,
        overwrite=run.overwrite,
    )
