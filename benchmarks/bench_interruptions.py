"""Kill a command over and over and see whether its result is still the same.

Runs a ``reachmap`` command once undisturbed, then again while injuring it, and compares
what it leaves: names of files, ``content_sha256`` of artefacts, answers but for
measured times. Three injuries, each counted in docs/explanation/reliability.md:

``--kills N``
    SIGKILL the command at N random moments, resuming it each time.
``--worker-every S``
    SIGKILL one of its workers every S seconds through one run.
``--room BYTES``
    Limit the size of its files, then lift the limit and resume.

Without any of them, a little of each is done to a small bin scan. ``--of KIND`` takes
a small command of that kind instead of one of your own; ``--of all`` goes through them.

Example: python benchmarks/bench_interruptions.py --kills 30 -- bin-scan
--cell ur5-eye-in-hand --set bin_scan.grid=[5,4] -j 2
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import h5py
import psutil

SMALL_SCAN = ["bin-scan", "--cell", "ur5-eye-in-hand", "-j", "2"]
SMALL_SCAN += ["--set", "bin_scan.grid=[5,4]", "--set", "bin_scan.repeats=2"]
TOY_STUDY = ["study", "planar-toy", "--set", "bin_scan.repeats=1", "-j", "2"]
TOY_STUDY += ["--vary", "bin_scan.grid=[3,3],[4,3],[4,4],[5,4]"]
CYCLES = ["bin-scan", "--cell", "ur5-conveyor", "-j", "2"]
CYCLES += ["--set", "bin_scan.grid=[3,2]", "--set", "bin_scan.repeats=1"]
# What is made first, by name, and then read by those below.
MADE = {
    "workspace.h5": ["workspace-scan", "planar-toy", "-j", "2"],
    "cycles.h5": CYCLES,
}
# A small command of each kind, and the name of its output.
KINDS = {
    "bin-scan": ("bin.h5", SMALL_SCAN),
    "cycles": ("bin.h5", CYCLES),
    "workspace-scan": ("workspace.h5", MADE["workspace.h5"]),
    "study": ("study.h5", TOY_STUDY),
    "study-place": ("study.h5", [*TOY_STUDY, "--place"]),
    "study-optimise": ("study.h5", [*TOY_STUDY, "--optimise", "3"]),
    "place-bin": ("placement.h5", ["place-bin", "workspace.h5", "-j", "2"]),
    "place-robot": ("robot.h5", ["place-robot", "planar-toy", "-j", "2"]),
    "robust": ("robust.h5", ["robust", "cycles.h5", "--bin", "5mm", "-j", "2"]),
    "empty": ("heaps.json", ["empty", "cycles.h5"]),
    "validate": ("validation.json", ["validate", "cycles.h5", "--random", "8"]),
    "run": ("run", ["run", "planar-toy", "--set", "bin_scan.repeats=1", "-j", "2"]),
}
MEASURED = {"planning_time", "planning_cpu_time", "simplification_time", "cpu_s"}
# Workers notice the death of the command that started them within this.
ORPHANS_S = 10.0


@dataclass(frozen=True, kw_only=True)
class Victim:
    """A command, where it runs, and what it leaves when nothing happens to it."""

    name: str
    output: str
    command: Sequence[str]
    folder: Path
    length_s: float = 0.0
    reference: str = ""


def main() -> int:
    """Run what the command line asks for; exit code 1 when a result differs."""
    options = parse_arguments()
    same = True
    with tempfile.TemporaryDirectory() as name:
        for victim in victims(options, Path(name)):
            begin = time.monotonic()
            code = start(victim, "undisturbed").wait()
            length_s = time.monotonic() - begin
            reference = digest(victim.folder / "undisturbed")
            print(f"{victim.name}: exit code {code}, {length_s:.1f} s", flush=True)
            known = vars(victim) | {"length_s": length_s, "reference": reference}
            same &= code == 0 and injure(Victim(**known), options)
    return 0 if same else 1


def injure(victim: Victim, options: argparse.Namespace) -> bool:
    """All injuries that were asked for; whether the result was always the same."""
    same = True
    if options.kills:
        same &= kill_often(victim, options)
    if options.worker_every:
        same &= kill_workers(victim, options)
    if options.room:
        same &= run_out_of_room(victim, options)
    return same


def victims(options: argparse.Namespace, folder: Path) -> list[Victim]:
    """The commands to injure; what they read is made first."""
    chosen = {"command": (options.output, options.command)}
    if options.of:
        names = [*KINDS] if "all" in options.of else options.of
        chosen = {name: KINDS[name] for name in names}
    read = {word for _, command in chosen.values() for word in command}
    inputs = {}
    for name in read & MADE.keys():
        making = Victim(name=name, output=name, command=MADE[name], folder=folder)
        if start(making, "inputs").wait() != 0:
            sys.exit(f"{name} could not be made")
        inputs[name] = str(folder / "inputs" / name)
    return [
        Victim(
            name=name,
            output=output,
            command=[inputs.get(word, word) for word in command],
            folder=folder / name,
        )
        for name, (output, command) in chosen.items()
    ]


def parse_arguments() -> argparse.Namespace:
    """Options, then the command after ``--``."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--worker-every", type=float, default=0.0)
    parser.add_argument("--room", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--of", action="append", choices=["all", *KINDS], metavar="KIND"
    )
    parser.add_argument("--output", default="out.h5", help="name of what is written")
    parser.add_argument("command", nargs="*", help="reachmap command without -o")
    options = parser.parse_args()
    options.command = options.command or SMALL_SCAN
    if not (options.kills or options.worker_every or options.room):
        options.kills, options.worker_every, options.room = 3, 2.0, 100_000
    return options


def kill_often(victim: Victim, options: argparse.Namespace) -> bool:
    """SIGKILL at random moments until there were enough, over as many runs."""
    rng, kills, runs, same, orphans = random.Random(options.seed), 0, 0, 0, 0
    while kills < options.kills:
        place, code = f"killed-{runs}", None
        while kills < options.kills and code is None:
            process = start(victim, place)
            with suppress(subprocess.TimeoutExpired):
                code = process.wait(timeout=rng.uniform(0.0, victim.length_s))
            if code is None:
                orphans += kill(process)
                kills += 1
        if code is None:
            start(victim, place).wait()
        runs += 1
        same += digest(victim.folder / place) == victim.reference
    left = len(list((victim.folder / "tmp").iterdir()))
    print(
        f"  {kills} SIGKILLs over {runs} runs, {same} of {runs} the same; {orphans} "
        f"workers outlived theirs, {left} temporary files left",
        flush=True,
    )
    return same == runs and not orphans


def kill(process: subprocess.Popen[str]) -> int:
    """SIGKILL a command; how many of its children do not notice."""
    children: list[psutil.Process] = []
    with suppress(psutil.NoSuchProcess):
        children = psutil.Process(process.pid).children(recursive=True)
    process.kill()
    process.wait()
    return len(psutil.wait_procs(children, timeout=ORPHANS_S)[1])


def kill_workers(victim: Victim, options: argparse.Namespace) -> bool:
    """SIGKILL a random worker at regular times through one run."""
    rng, kills = random.Random(options.seed), 0
    process = start(victim, "workers")
    while process.poll() is None:
        time.sleep(options.worker_every)
        if workers := workers_of(process):
            rng.choice(workers).kill()
            kills += 1
    same = digest(victim.folder / "workers") == victim.reference
    print(
        f"  workers: {kills} killed, exit code {process.returncode}, "
        f"{'the same' if same else 'NOT THE SAME'}"
    )
    return same and process.returncode == 0


def run_out_of_room(victim: Victim, options: argparse.Namespace) -> bool:
    """Run with a limit on the size of files, then without."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (options.room, options.room))

    process = start(victim, "room", before=limit, stderr=subprocess.PIPE)
    message = process.communicate()[1].strip().splitlines()
    code = start(victim, "room").wait()
    same = code == 0 and digest(victim.folder / "room") == victim.reference
    print(f"  no room: exit code {process.returncode}, {message[-3:]}")
    print(f"  resumed: exit code {code}, {'the same' if same else 'NOT THE SAME'}")
    return same and process.returncode == 3


def start(
    victim: Victim,
    place: str,
    *,
    before: Callable[[], None] | None = None,
    stderr: int = subprocess.DEVNULL,
) -> subprocess.Popen[str]:
    """Start a command with its output in a folder of its own."""
    folder, temporary = victim.folder / place, victim.folder / "tmp"
    for needed in (folder, temporary):
        needed.mkdir(parents=True, exist_ok=True)
    output = str(folder / victim.output)
    return subprocess.Popen(
        [sys.executable, "-m", "reachmap", *victim.command, "-o", output],
        stdout=subprocess.DEVNULL,
        stderr=stderr,
        text=True,
        env=os.environ | {"TMPDIR": str(temporary)},
        preexec_fn=before,
    )


def workers_of(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """Worker processes of a running command."""
    workers = []
    try:
        for child in psutil.Process(process.pid).children():
            with suppress(psutil.Error):  # it may end this moment
                if "spawn_main" in " ".join(child.cmdline()):
                    workers.append(child)
    except psutil.NoSuchProcess:
        return []
    return workers


def digest(folder: Path) -> str:
    """Hash of what a command left in its folder, but for measured times."""
    found = {
        path.relative_to(folder).as_posix(): content_of(path)
        for path in sorted(folder.rglob("*"))
    }
    return hashlib.sha256(json.dumps(found).encode()).hexdigest()


def content_of(path: Path) -> object:
    """What a file holds that does not depend on when it was made."""
    if path.suffix == ".h5":
        with h5py.File(path) as file:
            return str(file.attrs["content_sha256"])
    if path.suffix == ".json":
        return without_times(json.loads(path.read_text()))
    return None


def without_times(value: object) -> object:
    """JSON values without those that were measured."""
    if isinstance(value, dict):
        kept = value.items()
        return {k: without_times(v) for k, v in kept if k not in MEASURED}
    return [without_times(v) for v in value] if isinstance(value, list) else value


if __name__ == "__main__":
    sys.exit(main())
