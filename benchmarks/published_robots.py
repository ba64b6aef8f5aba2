"""From a robot description to a ranked list, without editing a file, for many robots.

Each line of the list names a robot as ``new-cell`` takes it: a path, and what follows
it (``name:=value``, ``--tip LINK``, ``--package NAME=FOLDER``). For each: new-cell,
check, inverse kinematics at random configurations, a reduced workspace scan, a reduced
bin scan, rank. A robot that cannot be used is one line of the table with the reason.

    python benchmarks/published_robots.py robots.txt --only ur --keep /tmp/cells > rows
    python benchmarks/published_robots.py --table rows

Each row holds the exit code of every command, what stderr said about a share of 0 %,
how the arm's inverse kinematics work and the seconds of CPU time.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
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


CPU_S = 300  # of one command: the slowest of those tried needs a third


class StepError(Exception):
    """A step that ended with another code than 0; the text is what it said."""


def run(*arguments: str, folder: Path, row: dict[str, object]) -> str:
    """Answer of a command of the tool; its exit code and complaints go into the row."""
    step = row["step"] = arguments[0]
    done = subprocess.run(
        [str(Path(sys.executable).with_name("reachmap")), *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (CPU_S, CPU_S + 5)),
    )
    codes = row.setdefault("exit", {})
    assert isinstance(codes, dict)
    codes[step] = done.returncode
    said = [line for line in done.stderr.splitlines() if line.strip()]
    if done.returncode != 0:
        raise StepError(" ".join(said[:3]) or "(nothing)")
    if any("nothing is reachable" in line for line in said):
        row[f"{step} said"] = said
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
    began = time.process_time() + sum(os.times()[2:4])
    try:
        words = [
            str(Path(word).absolute()) if Path(word).exists() else word
            for word in shlex.split(line)
        ]
        answer = run("new-cell", *words, "--json", folder=folder, row=row)
        made = json.loads(answer)
        row |= {"joints": len(made["joints"]), "tip": made["tip"]}
        row |= {"axis": made["approach_axis"], "notes": made["notes"]}
        run("check", "cell.yaml", "--json", folder=folder, row=row)
        row["step"] = "ik"
        method, complete, found = solved(folder / "cell.yaml", count)
        row |= {"ik": method, "complete": complete, "solved": f"{found}/{count}"}
        if scans:
            reduced_scans(folder, row)
        row["step"] = "done"
    except (StepError, ReachmapError) as error:
        row["why"] = str(error).splitlines()[0]
    finally:
        row["cpu_s"] = round(time.process_time() + sum(os.times()[2:4]) - began, 1)
    return row


def reduced_scans(folder: Path, row: dict[str, object]) -> None:
    """Workspace scan, bin scan and ranking of the cell in a folder."""
    joints = row["joints"]
    assert isinstance(joints, int)
    cone = ORIENTATIONS if joints >= FULL_AXES else ()
    words = [word for setting in (*SETTINGS, *cone) for word in ("--set", setting)]
    words += ["--no-progress", "-j", "1", "--json"]
    answer = run("workspace-scan", "cell.yaml", *words, folder=folder, row=row)
    row["workspace"] = json.loads(answer)
    answer = run("bin-scan", "--cell", "cell.yaml", *words, folder=folder, row=row)
    row["bin"] = json.loads(answer)
    (folder / "grasps.json").write_text(json.dumps(GRASPS))
    ranked = json.loads(run("rank", "grasps.json", folder=folder, row=row))
    row["ranked"] = len(ranked["grasps"])


def outcome(row: dict[str, object]) -> str:
    """How a robot went: through, nothing reached and why, refused, or wrong."""
    if row["step"] == "done":
        share = dict(row.get("bin") or {}).get("path_reachability_percent")
        if share != 0.0:
            return "through"
        return "0 % with a reason" if "bin-scan said" in row else "0 % IN SILENCE"
    codes = row["exit"]
    assert isinstance(codes, dict)
    code = codes.get(str(row["step"]))
    if code == -signal.SIGXCPU:
        return f"stopped after {CPU_S} s"
    return "refused" if code == 2 else "FAILED"


def table(rows: list[dict[str, object]]) -> str:
    """Rows as a table in Markdown, and how many went which way."""
    lines = [
        "| robot | axes | tip | IK | complete | solved | bin % | CPU s | outcome |"
    ]
    lines.append("|---" * 9 + "|")
    for row in rows:
        robot = " ".join(word.rpartition("/")[2] for word in str(row["robot"]).split())
        share = dict(row.get("bin") or {}).get("path_reachability_percent", "")
        cells = [robot, row.get("joints"), row.get("tip"), row.get("ik")]
        cells += [row.get("complete"), row.get("solved"), share, row["cpu_s"]]
        cells.append(f"{outcome(row)}: {row['why']}" if "why" in row else outcome(row))
        lines.append("| " + " | ".join(str(cell) for cell in cells) + " |")
    counts = Counter(outcome(row) for row in rows)
    lines += ["", ", ".join(f"{n} {how}" for how, n in counts.most_common())]
    return "\n".join(lines)


def main() -> None:
    """Print a row of JSON for each robot, and how many went through."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("robots", type=Path, help="list, one robot a line")
    parser.add_argument("--table", action="store_true", help="show rows made before")
    parser.add_argument("--only", default="", help="lines that contain this text")
    parser.add_argument("--count", type=int, default=200, help="random configurations")
    parser.add_argument("--keep", type=Path, help="folder to keep the cells in")
    parser.add_argument("--no-scans", action="store_true", help="up to check and IK")
    options = parser.parse_args()
    if options.table:
        text = options.robots.read_text()
        print(table([json.loads(line) for line in text.splitlines()]))
        return
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
