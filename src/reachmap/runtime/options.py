"""Options on how a command computes: one object, built once and passed whole."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from numbers import Integral
from pathlib import Path
from typing import TypeAlias
from urllib.parse import urlsplit

from reachmap.errors import SettingsError

SCHEMES = ("tcp", "tls", "ws", "wss")
WORKER_BYTES = 300 * 1024**2
"""Memory a worker is reckoned with: one of the shipped cells takes 150 to 200 MB."""

ExecutorChoice: TypeAlias = str | Callable[[], Executor]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """How work is carried out; nothing here changes its result.

    Attributes
    ----------
    workers : int
        Processes at most; 1 works in this process.
    executor : str or callable
        ``processes``; ``dask:local``, a Dask cluster on this machine for the length
        of the run; ``dask:tcp://HOST:PORT``, one that is there already; or what makes
        any ``concurrent.futures.Executor``, and makes it again after its workers died.
    shard : (int, int) or None
        (i, N): do the i-th of N shares, and leave the store for ``merge``.
    restart : bool
        Discard what an earlier run left.
    overwrite : bool
        Replace the output.
    quiet : bool
        Report no progress.

    Raises
    ------
    SettingsError
        For an executor that is none of these.
    """

    workers: int = 1
    executor: ExecutorChoice = "processes"
    shard: tuple[int, int] | None = None
    restart: bool = False
    overwrite: bool = False
    quiet: bool = True

    def __post_init__(self) -> None:
        if not _is_count(self.workers):
            raise SettingsError(f"workers: expected 1 or more (got {self.workers!r})")
        if self.shard is not None and not _is_share(self.shard):
            raise SettingsError(
                f"shard: expected (i, N) with i from 1 to N (got {self.shard!r})"
            )
        name = self.executor
        if not isinstance(name, str) or name in ("processes", "dask:local"):
            return
        if not name.startswith("dask:") or not _has_host(name.removeprefix("dask:")):
            raise SettingsError(
                f"executor {name!r}: expected processes, dask:local or "
                "dask:tcp://HOST:PORT"
            )


def _is_count(workers: object) -> bool:
    return isinstance(workers, Integral) and int(workers) >= 1


def _is_share(shard: object) -> bool:
    match shard:
        case (int(one), int(many)):
            return 1 <= one <= many
    return False


IN_PROCESS = RunOptions()


def _has_host(address: str) -> bool:
    try:
        parts = urlsplit(address)
        return parts.scheme in SCHEMES and bool(parts.hostname) and bool(parts.port)
    except ValueError:  # a port that is not a number, or is out of range
        return False


def available_cores() -> int:
    """Cores this process may use: affinity and the container's quota count."""
    try:
        cores = len(os.sched_getaffinity(0))
    except AttributeError:  # not on every system
        cores = os.cpu_count() or 1
    return max(1, math.ceil(min(cores, _quota_cores())))


def worker_count(wanted: int, units: int) -> int:
    """Processes to start: no more than there are units, and as memory allows."""
    return max(1, int(min(wanted, units, _free_bytes() // WORKER_BYTES)))


def _quota_cores(root: Path = Path("/sys/fs/cgroup")) -> float:
    quota, period = math.inf, 1.0
    if text := _text(root / "cpu.max"):  # version 2 of cgroups
        first, _, second = text.partition(" ")
        quota, period = _number(first), _number(second)
    elif text := _text(root / "cpu/cpu.cfs_quota_us"):
        quota = _number(text)
        period = _number(_text(root / "cpu/cpu.cfs_period_us"))
    return quota / period if 0 < quota < math.inf and period > 0 else math.inf


def _free_bytes(root: Path = Path("/sys/fs/cgroup")) -> float:
    """Memory that may still be taken; infinite where nothing says."""
    free = [math.inf]
    for line in _text(Path("/proc/meminfo")).splitlines():
        if line.startswith("MemAvailable:"):
            free.append(1024 * _number(line.split()[1]))
    for limit, used in (
        ("memory.max", "memory.current"),
        ("memory/memory.limit_in_bytes", "memory/memory.usage_in_bytes"),
    ):
        if text := _text(root / limit):
            free.append(_number(text) - _number(_text(root / used) or "0"))
    return min(free)


def _text(path: Path) -> str:
    try:
        return path.read_text("ascii").strip()
    except (OSError, ValueError):
        return ""


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:  # "max"
        return math.inf
