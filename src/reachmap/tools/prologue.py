"""What tools share: checks before any work, names of outputs, a warning after it."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from reachmap.cell.bins.support import STEADY_DEG, bodies_in_bin
from reachmap.cell.loaded import LoadedCell
from reachmap.cell.loading import cell_path
from reachmap.cell.text.data import text_at
from reachmap.cell.text.yaml_reader import parse_yaml
from reachmap.disk import is_there, one_or_more, real_path
from reachmap.errors import CellError, SettingsError
from reachmap.geometry import inverse_transform, tilt_rad
from reachmap.maps import BinMap, WorkspaceMap, check_output, check_outputs
from reachmap.maps.summary.statistics import why_unreachable
from reachmap.runtime.options import RunOptions
from reachmap.runtime.store import store_path

logger = logging.getLogger(__name__)


def check_scan_output(
    output: Path, run: RunOptions, inputs: Sequence[str | Path | None]
) -> None:
    """Refuse an output of a scan, as far as that needs no scene.

    An output with a journal beside it may be what an earlier part of this run has
    published; whether it is, the run itself finds out.
    """
    journal = store_path(output, run.shard)
    resumes = is_there(journal) and not run.restart
    target = output if run.shard is None else journal
    check_outputs([target], overwrite=run.overwrite or resumes, inputs=inputs)


def shards_of(run: RunOptions) -> int:
    """Shares that the work of a run is split into."""
    return 1 if run.shard is None else run.shard[1]


def path_of_cell(name_or_path: str | None) -> Path | None:
    """File of a cell, shipped or not; None where no cell is named or there is none."""
    with suppress(CellError):
        return None if name_or_path is None else cell_path(name_or_path)
    return None


def refuse_cell_files(outputs: Iterable[Path | None], *cells: LoadedCell) -> None:
    """Refuse outputs that would replace files of the cells.

    Raises
    ------
    OutputError
        An output is its URDF, SRDF, joint limits or a mesh.
    """
    for output in outputs:
        if output is not None and is_there(real_path(output)):
            for loaded in cells:
                check_output(output, overwrite=True, inputs=_files_of(loaded))


def _files_of(loaded: LoadedCell) -> Iterator[Path]:
    robot = loaded.cell.robot
    # The joint limits are merged into the cell, which then names no file of them.
    with suppress(CellError):
        text = parse_yaml(loaded.text, loaded.source).data
        for name in ("urdf", "srdf", "joint_limits"):
            reference = text_at(text, "robot", name)
            if reference:
                yield loaded.resolve(reference)
    for reference in (robot.urdf, robot.srdf):
        with suppress(CellError):
            if reference:
                yield loaded.resolve(reference)
    yield from loaded.mesh_paths.values()


def with_seed(overrides: Sequence[str], seed: int | None) -> tuple[str, ...]:
    """Append to overrides the seed of ``--seed``, if one was given."""
    return (*one_or_more(overrides), *(() if seed is None else (f"seed={seed}",)))


def check_places(
    limits: Mapping[str, tuple[float, float]],
    fixed: Mapping[str, float],
    *,
    axes: Sequence[str],
    top: int,
) -> None:
    """Refuse where to look for a place if that is nowhere.

    Parameters
    ----------
    limits, fixed : mapping
        Range or value by name.
    axes : sequence of str
        What may be fixed.
    top : int
        Places that are mapped.

    Raises
    ------
    SettingsError
        A range runs backwards or ends nowhere, an axis is unknown, or no place is left.
    """
    if top < 1:
        raise SettingsError(f"top {top}: expected at least 1")
    unknown = sorted(set(fixed) - set(axes))
    if unknown:
        raise SettingsError(f"--fix {unknown[0]}: expected one of {', '.join(axes)}")
    for name, (low, high) in limits.items():
        if not -math.inf < low <= high < math.inf:
            raise SettingsError(
                f"{name} from {low:g} to {high:g}: expected two numbers, the smaller "
                "one first"
            )
    for name, value in fixed.items():
        if not math.isfinite(value):
            raise SettingsError(f"--fix {name}={value:g}: expected a number")


def warn_of_moving(loaded: LoadedCell) -> None:
    """Warn of what a bin loses in place-bin: its lean, and bodies inside it."""
    cell = loaded.cell
    name = f"bin {cell.bin.name}" if cell.bin.name else "bin"
    T_level_bin = inverse_transform(cell.T_base_level()) @ cell.T_base_bin()
    lean_deg = math.degrees(tilt_rad(T_level_bin[:3, :3]))
    if lean_deg > STEADY_DEG:
        logger.warning(
            "%s: the %s leans by %.3g deg; it is placed upright (bin-scan --cell maps "
            "it as it leans)",
            loaded.source,
            name,
            lean_deg,
        )
    inside = bodies_in_bin(cell)
    if inside:
        logger.warning(
            "%s: inside the %s: %s. Bodies stay where they are when it is moved; make "
            "dividers part of its mesh (bin.mesh)",
            loaded.source,
            name,
            ", ".join(inside),
        )


def written_by(output: Path, run: RunOptions) -> Path:
    """Name the file that a scan leaves: the artefact, or the journal of a shard."""
    return output if run.shard is None else store_path(output, run.shard)


def warn_of_nothing(record: WorkspaceMap | BinMap | None, output: Path) -> None:
    """Warn on stderr if a map has nothing reachable, with the cause."""
    why = "" if record is None else why_unreachable(record)
    if why:
        logger.warning("%s: %s", output, why)
