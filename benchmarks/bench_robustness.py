"""Certified grasps and predicted yield against cells that were never looked at.

Every best path of a map, certified or not, is replayed in perturbed cells of another
seed, at the errors that ``reachmap robust`` was asked about: none that is certified
may fail, and the mean over the cells is the yield that it predicts.

    python benchmarks/bench_robustness.py bin.h5 robustness.h5 [cells]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from reachmap.maps import read_bin_map
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.robustness.format import read_robustness
from reachmap.motions.motion import best_rows
from reachmap.robustness.errors import Errors, ErrorSize, misplacement, unit_errors
from reachmap.robustness.problem import RobustnessProblem
from reachmap.robustness.replay import PerturbedCell, replay_unit

SEED = 12345


def main() -> None:
    """Print what failed, and both yields."""
    record = read_bin_map(Path(sys.argv[1]))
    told = read_robustness(Path(sys.argv[2]))
    assert told.provenance.source_sha256 == record.stamp.content_sha256
    cells = int(sys.argv[3]) if len(sys.argv) > 3 else 200
    sizes = (ErrorSize(shift_m=m, turn_rad=rad) for m, rad in told.sizes.tolist())
    errors = Errors(**dict(zip(("bin", "camera", "tool"), sizes, strict=True)))
    loaded = cell_of_artefact(record.provenance, sys.argv[1])
    problem = RobustnessProblem.of_map(
        record, loaded, best_rows(record), errors, told.margin_m
    )
    given = told.scale.tolist().index(1.0)
    certified = told.is_certified[given][problem.place]
    T_base_bin = loaded.cell.T_base_bin()
    shares, failed = [], 0
    for unit in unit_errors(cells, SEED):
        off = misplacement(errors, unit, T_base_bin, problem.T_base_camera)
        free = np.concatenate(
            [
                replay_unit(
                    problem.replay,
                    PerturbedCell(
                        filling=k,
                        rows=np.arange(len(problem.replay.stored[k].paths)),
                        misplacement=off,
                    ),
                )
                for k in problem.fillings
            ]
        )
        failed += int((certified & ~free).sum())
        shares.append(100.0 * float(free.sum()) / record.status.size)
    print(
        f"{cells} cells, {certified.sum()} certified of {len(certified)} paths: "
        f"{failed} certified failures; yield predicted "
        f"{told.reachability[given].mean():.2f} %, measured {np.mean(shares):.2f} % "
        f"(± {np.std(shares) / np.sqrt(cells):.2f})"
    )


if __name__ == "__main__":
    main()
