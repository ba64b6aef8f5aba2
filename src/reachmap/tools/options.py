"""Settings that several tools share."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from reachmap.errors import SettingsError
from reachmap.maps import BinMap, WorkspaceMap
from reachmap.maps.summary.unreachable import why_unreachable
from reachmap.runtime.options import RunOptions
from reachmap.runtime.store import store_path

logger = logging.getLogger(__name__)


def with_seed(overrides: Sequence[str], seed: int | None) -> tuple[str, ...]:
    """Append to overrides the seed of ``--seed``, if one was given."""
    return (*overrides, *(() if seed is None else (f"seed={seed}",)))


def check_places(
    limits: Mapping[str, tuple[float, float]], fixed: Mapping[str, float]
) -> None:
    """Refuse ranges that run backwards, and what is no number.

    Raises
    ------
    SettingsError
        Also of a range that ends nowhere.
    """
    for name, (low, high) in limits.items():
        if not -math.inf < low <= high < math.inf:
            raise SettingsError(
                f"{name} from {low:g} to {high:g}: expected two numbers, the smaller "
                "one first"
            )
    for name, value in fixed.items():
        if not math.isfinite(value):
            raise SettingsError(f"--fix {name}={value:g}: expected a number")


def written_by(output: Path, run: RunOptions) -> Path:
    """Name the file that a scan leaves: the artefact, or the journal of a shard."""
    return output if run.shard is None else store_path(output, run.shard)


def warn_of_nothing(record: WorkspaceMap | BinMap | None, output: Path) -> None:
    """Warn on stderr if a map has nothing reachable, with the cause."""
    why = "" if record is None else why_unreachable(record)
    if why:
        logger.warning("%s: %s", output, why)
