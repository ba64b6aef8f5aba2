"""From a robot description to a ranked list, without editing a file, for many robots.

Each line of the list names a robot as ``new-cell`` takes it: a path, and what follows
it (``name:=value``, ``--tip LINK``, ``--package NAME=FOLDER``). For each: new-cell,
check, inverse kinematics at random configurations, a reduced workspace scan, a reduced
bin scan, rank. A robot that cannot be used is one line of the table with the reason.

    python benchmarks/published_robots.py robots.txt --only ur --keep /tmp/cells
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from reachmap.cell.loading import read_cell
from reachmap.core.kinematics.kinematics import Kinematics
from reachmap.core.robot.model import RobotModel
from reachmap.errors import ReachmapError

SETTINGS = (
    "workspace_scan.cubes.0.grid=[4,3]",
    "workspace_scan.cubes.1.grid=[4,3]",
    "workspace_scan.repeats=1",
    "bin_scan.grid=[3,2]",
    "bin_scan.repeats=1",
)
# For the cone of arms with six axes or more.
ORIENTATIONS = tuple(
    f"{scan}.orientations.{setting}"
    for scan in ("workspace_scan", "bin_scan")
    for setting in ("azimuths=[1,4]", "rolls=2")
)
FULL_AXES = 6
GRASPS = {
    "format": "reachmap.grasps",
    "format_version": "1.0",
    "frame": "bin",
    "units": {"length": "m"},
    "direction_convention": "approach",
    "grasps": [
        {"id": f"g{k}", "position": [x, y, 0.05], "direction": [0, 0, -1]}
        for k, (x, y) in enumerate([(0, 0), (0.1, 0.05), (-0.1, -0.05), (0.1, -0.05)])
    ],
}


class StepError(Exception):
    """A step that ended with another code than 0; the text is what it said."""


def run(*arguments: str, folder: Path) -> str:
    """Answer of a command of the tool, with one worker and no progress."""
    done = subprocess.run(
        [str(Path(sys.executable).with_name("reachmap")), *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        said = [line for line in done.stderr.splitlines() if line.strip()]
        raise StepError(f"exit {done.returncode}: {said[0] if said else '(nothing)'}")
    return done.stdout


def solved(cell: Path, count: int) -> tuple[str, bool, int]:
    """How poses of random configurations are solved: method, complete, how many."""
    robot = RobotModel.from_cell(read_cell(str(cell)))
    kinematics = Kinematics(robot)
    rng = np.random.default_rng(1)
    low = np.maximum(robot.lower_rad, -2 * np.pi)
    high = np.minimum(robot.upper_rad, 2 * np.pi)
    found = 0
    for q in rng.uniform(low, high, (count, robot.dof)):
        T = kinematics.forward(q)
        misses = [
            np.abs(kinematics.forward(row) - T).max() for row in kinematics.solve(T)
        ]
        found += bool(misses) and min(misses) < 1e-5
    return kinematics.method, kinematics.complete, found


def chain(line: str, folder: Path, count: int, *, scans: bool) -> dict[str, object]:
    """Row of the table for one robot."""
    row: dict[str, object] = {"robot": line}
    quiet = ["--no-progress", "-j", "1"]
    began = time.process_time() + sum(os.times()[2:4])
    try:
        words = [
            str(Path(word).absolute()) if Path(word).exists() else word
            for word in shlex.split(line)
        ]
        row["step"] = "new-cell"
        made = json.loads(run("new-cell", *words, "--json", folder=folder))
        row |= {"joints": len(made["joints"]), "tip": made["tip"]}
        row |= {"axis": made["approach_axis"], "notes": made["notes"]}
        row["step"] = "check"
        run("check", "cell.yaml", "--json", folder=folder)
        row["step"] = "ik"
        method, complete, found = solved(folder / "cell.yaml", count)
        row |= {"ik": method, "complete": complete, "solved": f"{found}/{count}"}
        if not scans:
            row["step"] = "done"
            return row
        cone = ORIENTATIONS if len(made["joints"]) >= FULL_AXES else ()
        sets = [word for setting in (*SETTINGS, *cone) for word in ("--set", setting)]
        row["step"] = "workspace-scan"
        answer = run("workspace-scan", "cell.yaml", *sets, *quiet, "--json",
                     folder=folder)  # fmt: skip
        row["workspace"] = json.loads(answer)
        row["step"] = "bin-scan"
        answer = run("bin-scan", "--cell", "cell.yaml", *sets, *quiet, "--json",
                     folder=folder)  # fmt: skip
        row["bin"] = json.loads(answer)
        row["step"] = "rank"
        (folder / "grasps.json").write_text(json.dumps(GRASPS))
        ranked = json.loads(run("rank", "grasps.json", folder=folder))
        row["ranked"] = len(ranked["grasps"])
        row["step"] = "done"
    except (StepError, ReachmapError) as error:
        row["why"] = str(error).splitlines()[0]
    finally:
        row["cpu_s"] = round(time.process_time() + sum(os.times()[2:4]) - began, 1)
    return row


def main() -> None:
    """Print a row of JSON for each robot, and how many went through."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robots", type=Path, help="list, one robot a line")
    parser.add_argument("--only", default="", help="lines that contain this text")
    parser.add_argument("--count", type=int, default=200, help="random configurations")
    parser.add_argument("--keep", type=Path, help="folder to keep the cells in")
    parser.add_argument("--no-scans", action="store_true", help="up to check and IK")
    options = parser.parse_args()
    lines = [line.strip() for line in options.robots.read_text().splitlines()]
    through = tried = 0
    for number, line in enumerate(lines):
        if not line or line.startswith("#") or options.only not in line:
            continue
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            if options.keep is not None:
                folder = options.keep / f"{number:03d}"
                folder.mkdir(parents=True, exist_ok=False)
            row = chain(line, folder, options.count, scans=not options.no_scans)
        tried += 1
        through += row["step"] == "done"
        print(json.dumps(row), flush=True)
    print(f"{through} of {tried} robots went all the way", file=sys.stderr)


if __name__ == "__main__":
    main()
