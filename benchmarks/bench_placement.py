"""Placement of the bin: time of the command, and its choice against others.

The chosen pose, the paper's rule and random feasible poses are mapped in the same way:
every test grasp of the full grid by the roadmap, with the bin and the straight approach
in the scene. ``--plan`` plans to them for real as well, as bin-scan does. It maps the
workspace first unless it is given a map.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reachmap._typing import FloatArray
from reachmap.cell.loading import LoadedCell
from reachmap.core.collision.bin_fit import BinFit
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from reachmap.geometry import yaw_transform
from reachmap.maps import BinPlacement, Status, read_placement, read_workspace_map
from reachmap.maps.provenance import cell_of_artefact
from reachmap.placement.mapped.evaluator import Evaluation, open_evaluator
from reachmap.placement.mapped.exact import PlacedScene, Pose
from reachmap.placement.mapped.imaging import imaging_configurations
from reachmap.placement.mapped.sample import THIN, Grid, open_frames, sample_of
from reachmap.placement.predicted.region import Region, region_of
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress
from reachmap.tools.bin_scan import bin_scan
from reachmap.tools.place_bin import PlacementChoice, place_bin
from reachmap.tools.workspace_scan import workspace_scan

CELL = "ur5-eye-in-hand"
WORKERS = 2
QUIET = RunOptions(workers=WORKERS, quiet=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A pose to be compared, with the configuration that it is imaged from."""

    name: str
    pose: Pose
    q: FloatArray


def entries(
    loaded: LoadedCell, placement: BinPlacement, region: Region, count: int, seed: int
) -> list[Entry]:
    """Chosen pose, the paper's choice, and random feasible poses."""
    robot = RobotModel.from_cell(loaded)
    sample = sample_of(loaded.cell, THIN, open_frames(robot, loaded))
    scene = Scene.build(loaded, with_bin=True, bin_moves=True)

    def imaged_from(pose: Pose) -> FloatArray | None:
        placed = PlacedScene(scene, pose, sample)
        found = imaging_configurations(placed.scene, *placed.grasps)
        return next(found, None)

    chosen, paper = (
        _pose(placement.candidate_pose[k])
        for k in (placement.chosen, placement.paper_choice)
    )
    q_paper = imaged_from(paper)
    assert q_paper is not None
    found = [
        Entry(name="chosen", pose=chosen, q=placement.scan_configuration),
        Entry(name="paper's rule", pose=paper, q=q_paper),
    ]
    rng = np.random.default_rng(seed)
    fit = BinFit(robot, loaded, None)
    while len(found) < 2 + count:
        pose = _pose(rng.uniform(region.low, region.high))
        if fit.contact(yaw_transform(*pose)) is None:
            q = imaged_from(pose)
            if q is not None:
                found.append(Entry(name=f"random {len(found) - 1}", pose=pose, q=q))
    return found


def region_of_cell(loaded: LoadedCell, workspace: Path) -> Region:
    """Where place-bin searches without options."""
    found = read_workspace_map(workspace)
    layers = loaded.cell.bin_scan.layers
    heights = np.array([found.z.min() - min(layers), found.z.max()])
    return region_of(loaded.cell.placement, {"x": found.x, "y": found.y, "z": heights})


def mapped(loaded: LoadedCell, compared: list[Entry]) -> list[Evaluation]:
    """Every test grasp of each pose by the roadmap."""
    spec, inner = loaded.cell.bin_scan, loaded.cell.bin.inner
    x, y = spec.grid
    every: Grid = (x, y, 1) if inner[0] >= inner[1] else (y, x, 1)
    is_open = open_frames(RobotModel.from_cell(loaded), loaded)
    assert len(sample_of(loaded.cell, every, is_open).share) == spec.count()
    with open_evaluator(
        loaded,
        is_open,
        QUIET,
        progress=Progress("bench", quiet=True),
    ) as evaluator:
        return evaluator.evaluate(
            [entry.pose for entry in compared],
            np.array([entry.q for entry in compared]),
            grid=every,
        )


def planned_percent(workspace: Path, entry: Entry, folder: Path) -> float:
    """Path reachability of a bin-scan with one attempt for each test grasp."""
    x, y, z, yaw = entry.pose
    choice = PlacementChoice(bin_pose=(x, y, z, float(np.degrees(yaw))))
    placement = folder / f"placement {entry.name}.h5"
    place_bin(workspace, placement, choice=choice, run=QUIET)
    found = bin_scan(
        placement,
        folder / f"bin {entry.name}.h5",
        overrides=["bin_scan.repeats=1"],
        run=QUIET,
    )
    assert found is not None
    return 100.0 * float((found.status == Status.PATH_FOUND).mean())


def table(compared: list[Entry], found: list[Evaluation]) -> None:
    """One line per pose, best first."""
    print(f"{'':>13}      x      y      z   yaw  score %  worst point %  path [rad]")
    rows = sorted(zip(compared, found, strict=True), key=lambda row: -_score(row[1]))
    for entry, evaluation in rows:
        x, y, z, yaw = entry.pose
        score = evaluation.score
        said = evaluation.reason
        if score is not None:
            said = (
                f"{score.score:8.2f} {score.worst_point:13.1f} "
                f"{score.path_length_rad:12.2f}"
            )
        where = f"{x:+.3f} {y:+.3f} {z:+.3f} {np.degrees(yaw):4.0f}°"
        print(f"{entry.name:>13} {where} {said}")
    scores = np.array([_score(e) for e in found[2:]])
    print(
        f"random: mean {scores.mean():.2f} %, best {scores.max():.2f} %; "
        f"chosen at least as good as {(scores <= _score(found[0])).sum()} of "
        f"{len(scores)}, and {_score(found[0]) - _score(found[1]):+.2f} points against "
        "the paper's rule"
    )


def timed(what: str, work: Callable[[], object]) -> None:
    """Do some work and print its wall time."""
    begin = time.perf_counter()
    work()
    print(f"{what}: {time.perf_counter() - begin:.1f} s wall, {WORKERS} workers")


def main() -> None:
    """Place the bin, map the alternatives, and print the comparison."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workspace", type=Path, help="a map to start from")
    parser.add_argument("--random", type=int, default=20, metavar="N")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--plan", action="store_true", help="also run bin-scans")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        workspace, output = options.workspace, folder / "placement.h5"
        if workspace is None:
            workspace = folder / "workspace.h5"
            timed("workspace-scan", lambda: workspace_scan(CELL, workspace, run=QUIET))
        timed("place-bin", lambda: place_bin(workspace, output, run=QUIET))
        source = read_workspace_map(workspace)
        loaded = cell_of_artefact(source.provenance, str(workspace), ())
        region = region_of_cell(loaded, workspace)
        compared = entries(
            loaded, read_placement(output), region, options.random, options.seed
        )
        found = mapped(loaded, compared)
        table(compared, found)
        if options.plan:
            best = 2 + int(np.argmax([_score(e) for e in found[2:]]))
            for entry in (*compared[:2], compared[best]):
                percent = planned_percent(workspace, entry, folder)
                print(f"planned once to each grasp, {entry.name}: {percent:.2f} %")


def _pose(values: FloatArray) -> Pose:
    x, y, z, yaw = np.asarray(values).tolist()
    return x, y, z, yaw


def _score(evaluation: Evaluation) -> float:
    return evaluation.score.score if evaluation.score is not None else -1.0


if __name__ == "__main__":
    main()
