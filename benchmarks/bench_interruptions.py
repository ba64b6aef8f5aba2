"""Kill a scan over and over and see whether its result is still the same.

Runs a ``reachmap`` scan once undisturbed, then again while injuring it, and compares
``content_sha256``. Three injuries, each counted in docs/explanation/reliability.md:

``--kills N``
    SIGKILL the command at N random moments, resuming it each time.
``--worker-every S``
    SIGKILL one of its workers every S seconds through one run.
``--room BYTES``
    Limit the size of its files, then lift the limit and resume.

Without any of them, a little of each is done to a small bin scan.

Example: python benchmarks/bench_interruptions.py --kills 30 -- bin-scan
--cell ur5-eye-in-hand --set bin_scan.grid=[5,4] -j 2
"""

from __future__ import annotations

import argparse
import random
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import h5py
import psutil

SMALL_SCAN = ["bin-scan", "--cell", "ur5-eye-in-hand", "-j", "2"]
SMALL_SCAN += ["--set", "bin_scan.grid=[5,4]", "--set", "bin_scan.repeats=2"]


def main() -> int:
    """Run what the command line asks for; exit code 1 when a result differs."""
    options = parse_arguments()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        begin = time.monotonic()
        code = start(options.command, folder / "undisturbed.h5").wait()
        length_s = time.monotonic() - begin
        reference = content_sha256(folder / "undisturbed.h5")
        print(f"undisturbed: exit code {code}, {length_s:.1f} s, {reference[:12]}…")
        same = code == 0
        if options.kills:
            same &= kill_often(options, folder, length_s, reference)
        if options.worker_every:
            same &= kill_workers(options, folder, reference)
        if options.room:
            same &= run_out_of_room(options, folder, reference)
    return 0 if same else 1


def parse_arguments() -> argparse.Namespace:
    """Options, then the command after ``--``."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--worker-every", type=float, default=0.0)
    parser.add_argument("--room", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("command", nargs="*", help="reachmap command without -o")
    options = parser.parse_args()
    options.command = options.command or SMALL_SCAN
    if not (options.kills or options.worker_every or options.room):
        options.kills, options.worker_every, options.room = 3, 2.0, 100_000
    return options


def kill_often(
    options: argparse.Namespace, folder: Path, length_s: float, reference: str
) -> bool:
    """SIGKILL at random moments until there were enough, over as many scans."""
    rng, kills, scans, same = random.Random(options.seed), 0, 0, 0
    while kills < options.kills:
        output = folder / f"killed-{scans}.h5"
        while kills < options.kills and not output.exists():
            process = start(options.command, output)
            try:
                process.wait(timeout=rng.uniform(0.0, length_s))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                kills += 1
        if not output.exists():
            start(options.command, output).wait()
        scans += 1
        same += content_sha256(output) == reference
    print(f"killed: {kills} SIGKILLs over {scans} scans, {same} of {scans} the same")
    return same == scans


def kill_workers(options: argparse.Namespace, folder: Path, reference: str) -> bool:
    """SIGKILL a random worker at regular times through one run."""
    rng, kills = random.Random(options.seed), 0
    output = folder / "workers.h5"
    process = start(options.command, output)
    while process.poll() is None:
        time.sleep(options.worker_every)
        if workers := workers_of(process):
            rng.choice(workers).kill()
            kills += 1
    same = process.returncode == 0 and content_sha256(output) == reference
    print(
        f"workers: {kills} killed, exit code {process.returncode}, "
        f"{'the same' if same else 'NOT THE SAME'}"
    )
    return same


def run_out_of_room(options: argparse.Namespace, folder: Path, reference: str) -> bool:
    """Run with a limit on the size of files, then without."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (options.room, options.room))

    output = folder / "room.h5"
    process = start(options.command, output, before=limit, stderr=subprocess.PIPE)
    message = process.communicate()[1].strip().splitlines()[-1:]
    code = start(options.command, output).wait()
    same = code == 0 and content_sha256(output) == reference
    print(f"no room: exit code {process.returncode}, {message}")
    print(f"resumed: exit code {code}, {'the same' if same else 'NOT THE SAME'}")
    return same and process.returncode == 3


def start(
    command: Sequence[str],
    output: Path,
    *,
    before: Callable[[], None] | None = None,
    stderr: int = subprocess.DEVNULL,
) -> subprocess.Popen[str]:
    """Start a reachmap command with an output of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "reachmap", *command, "-o", str(output)],
        stdout=subprocess.DEVNULL,
        stderr=stderr,
        text=True,
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


def content_sha256(path: Path) -> str:
    """Hash of everything that is computed, "" when there is no file."""
    if not path.exists():
        return ""
    with h5py.File(path) as file:
        return str(file.attrs["content_sha256"])


if __name__ == "__main__":
    sys.exit(main())
