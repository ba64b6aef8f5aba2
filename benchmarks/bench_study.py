"""What a study saves: CPU time of 30 variants in one process, and of separate runs.

``python benchmarks/bench_study.py SET [--every N] [--only A:B]`` maps variants of the
shipped UR5 cell on a reduced grid, each with workspace-scan, place-bin and bin-scan:

- ``room``: ten heights of the pedestal by three places of the back wall; arm and tool
  are the same;
- ``mixed``: three tubes by ten heights of the pedestal;
- ``bin``: ten depths of the bin by three thicknesses of its walls;
- ``tool``: thirty tubes, so that everything changes.

Every N-th variant is also mapped by three commands in processes of their own, whose
CPU time (children included) stands for the others, and must give the same content
hashes. Each variant is a line as soon as it is done; the last line sums up.
"""

from __future__ import annotations

import argparse
import itertools
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from reachmap.cell.loading import read_cell
from reachmap.maps import read_bin_map, read_placement, read_workspace_map
from reachmap.maps.study.record import ALWAYS
from reachmap.tools.variant import (
    VariantContext,
    VariantUnit,
    compute_variant,
    map_workspace,
    workspace_key,
)

CELL = "ur5-eye-in-hand"
# Small enough that thirty variants and the separate runs beside them take minutes.
GRID = (
    "workspace_scan.cubes.0.grid=[3,2]",
    "workspace_scan.cubes.1.grid=[3,2]",
    "workspace_scan.z_step=0.5",
    "workspace_scan.orientations.rolls=1",
    "bin_scan.grid=[3,2]",
    "bin_scan.repeats=1",
    "bin_scan.orientations.tilts_deg=[0,30]",
    "bin_scan.orientations.azimuths=[1,8]",
    "bin_scan.orientations.rolls=[1,1]",
    "bin_scan.orientations.roll_offset_deg=[180,180]",
    "roadmap.max_checks=4000",
    "roadmap.sample_checks=4000",
)
TUBE, HEIGHT = "parameters.tube_length={:.4g}", "parameters.pedestal_height={:.4g}"
WALL = "bodies.back structure.pose.xyz.0={:.4g}"
DEPTH, THICKNESS = "bin.inner.2={:.4g}", "bin.wall={:.4g}"
HEIGHTS = np.linspace(0.70, 0.88, 10)
SETS: dict[str, tuple[tuple[str, Sequence[float]], ...]] = {
    "room": ((WALL, (-0.55, -0.60, -0.65)), (HEIGHT, HEIGHTS)),
    "mixed": ((TUBE, (0.119, 0.169, 0.219)), (HEIGHT, HEIGHTS)),
    "bin": (
        (THICKNESS, (0.004, 0.006, 0.008)),
        (DEPTH, np.linspace(0.05, 0.095, 10)),
    ),
    "tool": ((TUBE, np.linspace(0.10, 0.245, 30)),),
}


def variants(name: str) -> list[list[str]]:
    """Overrides of each variant of a set."""
    texts = [[key.format(value) for value in values] for key, values in SETS[name]]
    return [list(row) for row in itertools.product(*texts)]


class Shared:
    """Variants one after the other in this process, as a study computes them."""

    def __init__(self) -> None:
        self._workspaces: dict[str, dict] = {}

    def hashes(self, changes: Sequence[str]) -> dict[str, str]:
        """Content hashes of the maps of a variant."""
        loaded = read_cell(CELL, [*GRID, *changes])
        key = workspace_key(loaded)
        if key not in self._workspaces:
            self._workspaces = {key: map_workspace(None, loaded)}
        context = VariantContext(
            objectives=ALWAYS, places_bin=True, workspaces=[self._workspaces[key]]
        )
        found = compute_variant(context, VariantUnit(loaded=loaded, workspace=0))
        if found["cause"]:
            print("failed:", found["cause"])
        return found["sha256"]


def separate(changes: Sequence[str]) -> tuple[float, dict[str, str]]:
    """CPU seconds and content hashes of three commands of their own."""
    settings = [word for text in (*GRID, *changes) for word in ("--set", text)]
    begin = resource.getrusage(resource.RUSAGE_CHILDREN)
    with tempfile.TemporaryDirectory() as folder:
        for command in (
            ["workspace-scan", CELL, *settings, "-o", "w.h5"],
            ["place-bin", "w.h5", "-o", "p.h5"],
            ["bin-scan", "p.h5", "-o", "b.h5"],
        ):
            subprocess.run(
                [sys.executable, "-m", "reachmap", *command, "-j", "1", "--quiet"],
                cwd=folder,
                stdout=subprocess.DEVNULL,
                check=True,
            )
        records = {
            "workspace": read_workspace_map(Path(folder, "w.h5")),
            "placement": read_placement(Path(folder, "p.h5")),
            "bin": read_bin_map(Path(folder, "b.h5")),
        }
    end = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = end.ru_utime + end.ru_stime - begin.ru_utime - begin.ru_stime
    return cpu_s, {name: r.stamp.content_sha256 for name, r in records.items()}


def main() -> None:
    """Measure a set."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("set", choices=[*SETS])
    parser.add_argument("--every", type=int, default=1, metavar="N")
    parser.add_argument("--only", default=":", metavar="A:B")
    options = parser.parse_args()
    first, _, last = options.only.partition(":")
    chosen = variants(options.set)[slice(int(first or 0), int(last) if last else None)]
    shared, apart = Shared(), []
    together = [time.process_time()]  # the start of the program, once
    for number, changes in enumerate(chosen):
        begin = sum(_cpu())
        hashes = shared.hashes(changes)
        together.append(sum(_cpu()) - begin)
        line = f"{', '.join(changes)}: together {together[-1]:.2f} s"
        if number % options.every == 0:
            cpu_s, own = separate(changes)
            apart.append(cpu_s)
            line += (
                f", apart {cpu_s:.2f} s, {'equal' if own == hashes else 'DIFFERENT'}"
            )
        print(line, flush=True)
    share = sum(together) / (len(chosen) * np.mean(apart))
    print(
        f"{options.set}: {len(chosen)} variants {sum(together):.1f} s together, "
        f"{np.mean(apart):.1f} s each apart ({len(apart)} measured): {share:.3f}"
    )


def _cpu() -> tuple[float, float]:
    """CPU seconds of this process, and of its children."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time(), used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
