"""Writing pictures and tables atomically, without overwriting."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from reachmap._typing import FloatArray
from reachmap.maps.bytes.publish import check_outputs, make_folder, publish
from reachmap.plots.parts.style import Format, figure_bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A file to write: its name without suffix, and how to draw it.

    Attributes
    ----------
    name : str
        Such as ``path_z+0.00``.
    title : str
        Kept in the file's metadata.
    draw : callable
        Makes the figure; called when the file is written, so that one figure at a
        time is in memory.
    """

    name: str
    title: str
    draw: Callable[[], Figure]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A CSV file to write: its name without suffix, and its text."""

    name: str
    text: str


def write_all(
    folder: Path,
    items: Iterable[Picture | Table],
    *,
    kind: Format = "png",
    config_sha256: str,
    overwrite: bool = False,
    inputs: Sequence[Path] = (),
) -> tuple[Path, ...]:
    """Write pictures and tables into a folder, which is made if it is missing.

    All places are checked before the first file is written.

    Returns
    -------
    tuple of Path
        The files, in the order of the items.

    Raises
    ------
    OutputError
        A file exists and ``overwrite`` is off, or the folder cannot be written.
    """
    items = tuple(items)
    make_folder(folder)
    paths = tuple(
        folder / f"{item.name}.{'csv' if isinstance(item, Table) else kind}"
        for item in items
    )
    check_outputs(paths, overwrite=overwrite, inputs=inputs)
    for path, item in zip(paths, items, strict=True):
        if isinstance(item, Table):
            data = item.text.encode()
        else:
            data = figure_bytes(
                item.draw(), kind, title=item.title, config_sha256=config_sha256
            )
        publish(path, [data], overwrite=overwrite)
    return paths


def write_picture(
    path: Path,
    figure: Figure,
    *,
    title: str,
    config_sha256: str,
    overwrite: bool = False,
) -> Path:
    """Write one figure; the suffix, .svg or any other, says how.

    Raises
    ------
    OutputError
        The file exists and ``overwrite`` is off, or it cannot be written.
    """
    kind: Format = "svg" if path.suffix == ".svg" else "png"
    data = figure_bytes(figure, kind, title=title, config_sha256=config_sha256)
    return publish(path, [data], overwrite=overwrite)


def write_only_picture(
    path: Path,
    album: Iterable[Picture | Table],
    *,
    config_sha256: str,
    overwrite: bool = False,
) -> Path:
    """Write the one picture of an album to a file; see :func:`write_picture`."""
    (picture,) = (item for item in album if isinstance(item, Picture))
    return write_picture(
        path,
        picture.draw(),
        title=picture.title,
        config_sha256=config_sha256,
        overwrite=overwrite,
    )


def level_table(x: FloatArray, y: FloatArray, values: FloatArray) -> str:
    """CSV of one level as the picture shows it: the largest y in the first row.

    Parameters
    ----------
    x, y : array, shape (nx,), (ny,)
        Centres of the squares [m], in the first row and the first column.
    values : array, shape (ny, nx)
        NaN leaves its field empty.
    """
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(["y \\ x [m]", *(_number(v) for v in x)])
    for row in reversed(range(len(y))):
        writer.writerow([_number(y[row]), *(_number(v) for v in values[row])])
    return stream.getvalue()


def _number(value: float) -> str:
    """Shortest decimal with at most 6 places; lattice points come as 0.1, not 0.1…01.

    Examples
    --------
    >>> _number(0.30000000000000004), _number(-1e-17), _number(float("nan"))
    ('0.3', '0', '')
    """
    if np.isnan(value):
        return ""
    return f"{round(float(value), 6) + 0.0:.6f}".rstrip("0").rstrip(".")
