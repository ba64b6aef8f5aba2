"""Worst cases of the placed bin, of the paper's rule and of random poses in hard cells.

``place-bin`` looks at its tolerance in the four directions of the plane, and confirms
what it chose; here the worst of seventeen poses counts: the pose itself and eight
directions with either turn, in height too where nothing supports the bin. All poses are
asked in the same way, with more points than ``place-bin`` takes for neighbours, every
orientation, and the checks that a map has, of which the search has a quarter: what it
misses for want of checks is no worse case of the pose. Random poses are
feasible as the search means it: clear of all, on a support where the cell has one,
within the camera's sight. One that scores less than the chosen pose's worst case has
lost, as has one with such a neighbour; its figure then is an upper bound. Worst cases
that differ by less than a twentieth of a point are the same.

    python benchmarks/bench_worst_case.py CELL.yaml... [--random N] [--set KEY=VALUE]
"""

from __future__ import annotations

import argparse
import dataclasses
import tempfile
from collections.abc import Iterator, Sequence
from itertools import product
from pathlib import Path

import numpy as np

from reachmap.cell.loading import read_cell
from reachmap.errors import ReachmapError
from reachmap.maps import read_workspace_map
from reachmap.maps.provenance import cell_of_artefact
from reachmap.placement.decision import paper_pose
from reachmap.placement.mapped.evaluator import open_evaluator
from reachmap.placement.mapped.exact import SHARE_OF_CHECKS, Pose
from reachmap.placement.mapped.sample import DENSE, Grid
from reachmap.placement.problem import PlacementProblem
from reachmap.placement.tolerance import moved_by
from reachmap.runtime.options import RunOptions
from reachmap.runtime.progress import Progress
from reachmap.tools.place_bin import PlacementChoice, placed_bin
from reachmap.tools.workspace_scan import workspace_scan

QUIET = RunOptions(workers=1, quiet=True)
GRID: Grid = DENSE
SEED, TRIES = 1, 4000
SAME_POINTS = 0.05


def neighbourhood(pose: Pose, problem: PlacementProblem) -> Iterator[Pose]:
    """The pose and the edge of what its tolerance allows."""
    yield pose
    scale, floats = problem.tolerance.scale, problem.tolerance.floats
    for angle, turn in product(np.radians(np.arange(0, 360, 45)), (1.0, -1.0)):
        yield moved_by(pose, scale * [np.cos(angle), np.sin(angle), 0.0, turn])
    for sign in (1.0, -1.0) if floats else ():
        yield moved_by(pose, scale * [0.0, 0.0, sign, 0.0])


def worst(pose: Pose, problem: PlacementProblem, enough_below: float = -1.0) -> float:
    """Least score of a neighbourhood [percent]; 0 where the bin cannot stand.

    Ends where a score is below a number.
    """
    found = 100.0
    poses = list(neighbourhood(pose, problem))
    # Contact costs next to nothing, so it is asked everywhere first.
    if any(problem.fit.contact(problem.T_base_bin(near)) for near in poses):
        return 0.0
    for near in poses:
        (here,) = problem.evaluator.evaluate([near], problem.start, grid=GRID)
        found = min(found, 0.0 if here.score is None else here.score.score)
        if found <= enough_below:
            break
    return found


def random_poses(problem: PlacementProblem, count: int) -> list[Pose]:
    """Feasible poses, uniform over the region and over supports."""
    rng, found = np.random.default_rng(SEED), []
    region, bottom = problem.region, problem.loaded.cell.bin.bottom_m
    for _ in range(TRIES):
        x, y, z, yaw = rng.uniform(region.low, region.high).tolist()
        if problem.supports:
            face = problem.supports[rng.integers(len(problem.supports))]
            z = face.z + bottom
        pose = (x, y, z, yaw)
        if not problem.reason_against(pose) and problem.can_be_imaged(pose):
            found.append(pose)
        if len(found) == count:
            break
    return found


def compare(cell: str, overrides: Sequence[str], count: int, folder: Path) -> None:
    """Place the bin of one cell and print the worst cases."""
    workspace = folder / "workspace.h5"
    workspace_scan(cell, workspace, overrides=overrides, run=QUIET)
    mapped = read_workspace_map(workspace)
    loaded = cell_of_artefact(mapped.provenance, str(workspace), ())
    placed = placed_bin(loaded, mapped, PlacementChoice(), QUIET)
    placement, problem = placed.placement, placed.problem
    x, y, z, yaw = placement.candidate_pose[placement.chosen].tolist()
    chosen: Pose = (x, y, z, yaw)
    progress = Progress("bench", quiet=True)
    checks = SHARE_OF_CHECKS * loaded.cell.roadmap.max_checks
    loaded = read_cell(cell, [*overrides, f"roadmap.max_checks={checks}"])
    with open_evaluator(loaded, problem.is_open, QUIET, progress=progress) as evaluator:
        problem = dataclasses.replace(problem, evaluator=evaluator)
        own = worst(chosen, problem)
        paper = paper_pose(problem)
        of_paper = np.nan if paper is None else worst(paper, problem, own - SAME_POINTS)
        poses = random_poses(problem, count)
        others = [worst(pose, problem, own - SAME_POINTS) for pose in poses]
    name = read_cell(cell, overrides).cell.name
    where = f"{x:+.3f} {y:+.3f} {z:+.3f} {np.degrees(yaw):.0f}°"
    stands = placement.support or "floats"
    limit = 100.0 * float(problem.is_open.mean())
    gain = np.array(others) - own
    worse, better = (gain <= -SAME_POINTS).sum(), (gain >= SAME_POINTS).sum()
    print(
        f"{name}: {where} on {stands}; no pose can have more than {limit:.2f} % for "
        f"the tool; worst case {own:.2f} %, told "
        f"{placement.worst_score[placement.chosen]:.2f} ± "
        f"{placement.score_error[placement.chosen]:.1f} %, paper's rule "
        f"{of_paper:.2f} %; of {len(others)} random poses {worse} are worse, {better} "
        f"better (best {max(others, default=np.nan):.2f} %), supports "
        f"{len(problem.supports)}, {evaluator.cpu_s:.0f} s",
        flush=True,
    )


def main() -> None:
    """Print one line a cell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cells", nargs="+")
    parser.add_argument("--random", type=int, default=20, metavar="N")
    parser.add_argument("--set", dest="overrides", action="append", default=[])
    options = parser.parse_args()
    for cell in options.cells:
        with tempfile.TemporaryDirectory() as name:
            try:
                compare(cell, options.overrides, options.random, Path(name))
            except ReachmapError as error:
                print(f"{cell}: {error}", flush=True)


if __name__ == "__main__":
    main()
