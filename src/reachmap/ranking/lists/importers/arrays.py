"""Arrays of grasps, one a row: GraspNet's 17 columns and suction's 7."""

from __future__ import annotations

import io
import math
import warnings
import zipfile
from typing import Any, Final

import numpy as np
import numpy.lib.format as npy

from reachmap._typing import FloatArray
from reachmap.errors import GraspListError
from reachmap.ranking.lists.document import MAX_GRASPS

# Networks answer in half precision, three digits.
UNIT_TOLERANCE: Final = 1e-2
# A choice: the limit of lists, for what an archive unpacks to.
MAX_NPZ_BYTES: Final = 32 * 2**20
# Rows as graspnetAPI stores them; the functions below name the columns.
GRASPNET_COLUMNS: Final = 17
SUCTION_COLUMNS: Final = 7
# A choice: no number of a grasp is as large, in any unit.
MAX_VALUE: Final = 1e9


def array_from_npy(data: bytes, source: str, *, finite: bool = True) -> FloatArray:
    """Rows of a ``.npy`` file.

    Nothing is unpickled, and the size that the header claims is compared with the
    file before anything is allocated.

    Parameters
    ----------
    data : bytes
    source : str
        Name of the file in messages.
    finite : bool
        Whether rows with NaN or infinity are refused.

    Returns
    -------
    array, shape (n, columns)
        A single row may be stored flat, and none without columns.
    """
    stream = io.BytesIO(data)
    try:
        is_first = npy.read_magic(stream) == (1, 0)
        read = npy.read_array_header_1_0 if is_first else npy.read_array_header_2_0
        with warnings.catch_warnings(action="ignore"):  # headers as Python 2 wrote them
            shape, _, dtype = read(stream)
    except Exception:
        # On damaged headers NumPy raises whatever its parsers raise.
        raise GraspListError(f"{source}: not a readable .npy file") from None
    size = len(data) - stream.tell()
    if (
        dtype.kind not in "fiu"
        or min(shape, default=0) < 0
        or size != math.prod(shape) * dtype.itemsize
    ):
        raise GraspListError(
            f"{source}: expected a complete array of numbers "
            f"(got {dtype.str!a} {shape} in {len(data)} bytes)"
        )
    rows = np.load(io.BytesIO(data), allow_pickle=False).astype(float)
    rows = np.atleast_2d(rows) if rows.size else _without_rows(rows)
    return _checked(rows, source, finite=finite)


def _without_rows(rows: FloatArray) -> FloatArray:
    """No rows: an image in which a network found nothing is stored as ``(0,)``."""
    return rows.reshape(0, GRASPNET_COLUMNS) if rows.shape == (0,) else rows


def array_from_npz(data: bytes, source: str, *, finite: bool = True) -> FloatArray:
    """Return the one array with 17 or 7 columns in an ``.npz`` file."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [m for m in archive.infolist() if m.filename.endswith(".npy")]
            size = sum(member.file_size for member in members)
            readable = members if size <= MAX_NPZ_BYTES else []
            contents = {m.filename[:-4]: archive.read(m) for m in readable}
    except Exception as error:
        # On damaged archives zipfile raises whatever its decompressors raise.
        raise GraspListError(f"{source}: not a readable .npz file: {error}") from None
    if size > MAX_NPZ_BYTES:
        raise GraspListError(f"{source}: more than {MAX_NPZ_BYTES} bytes inside")
    found: dict[str, FloatArray] = {}
    mistakes: list[str] = []
    for name, content in contents.items():
        try:
            found[name] = array_from_npy(
                content, f"{source}, array {name!a}", finite=finite
            )
        except GraspListError as error:
            mistakes += error.lines
    if len(found) == 1:
        return next(iter(found.values()))
    if not found and mistakes:
        raise GraspListError(mistakes[:20])
    raise GraspListError(
        f"{source}: expected one array with {GRASPNET_COLUMNS} or {SUCTION_COLUMNS} "
        f"columns (got {len(found)} among {sorted(contents)[:10]})"
    )


def _checked(rows: FloatArray, source: str, *, finite: bool) -> FloatArray:
    if rows.ndim != 2 or rows.shape[1] not in (GRASPNET_COLUMNS, SUCTION_COLUMNS):
        raise GraspListError(
            f"{source}: expected {GRASPNET_COLUMNS} columns (GraspNet) or "
            f"{SUCTION_COLUMNS} (suction); the array has the shape {rows.shape}"
        )
    if len(rows) > MAX_GRASPS:
        raise GraspListError(f"{source}: {len(rows)} rows; the limit is {MAX_GRASPS}")
    # The comparison is false for NaN as well.
    bad = np.flatnonzero(~(np.abs(rows) < MAX_VALUE).all(axis=1))
    if bad.size and finite:
        raise GraspListError(
            f"{source}: {bad.size} rows hold NaN, infinity or numbers beyond "
            f"{MAX_VALUE:g}; the first is row {bad[0]}"
        )
    return rows


def document_from_graspnet(rows: FloatArray, source: str) -> dict[str, Any]:
    """GraspNet-1Billion and AnyGrasp rows.

    Columns: score, width, height, depth, rotation matrix by rows (9), grasp centre
    (3), object. The approach axis is the gripper's +x, the first column of the
    matrix; the position is the grasp centre, from which the fingers reach ``depth``
    further along the approach.
    """
    if len(rows) and rows.shape[1] != GRASPNET_COLUMNS:
        raise GraspListError(f"{source}: GraspNet has 17 columns (got {rows.shape[1]})")
    grasps = [
        {
            "position": row[13:16],
            "rotation_matrix": [row[4:7], row[7:10], row[10:13]],
            "score": row[0],
            "width": row[1],
            "object_id": int(row[16]) if math.isfinite(row[16]) else row[16],
            "x_height": row[2],
            "x_depth": row[3],
        }
        for row in rows.tolist()
    ]
    return {"approach_axis": "+x", "grasps": grasps}


def document_from_suction(
    rows: FloatArray, source: str, order: str = "auto"
) -> dict[str, Any]:
    """Suction rows: score, then normal and point in either order.

    SuctionNet-1Billion writes the normal before the point; others write the point
    first. The normal is the triple that has unit length in every row. It points out
    of the surface, against the approach.

    Parameters
    ----------
    rows : array, shape (n, 7)
    source : str
    order : {"auto", "normal-first", "point-first"}
    """
    if not len(rows):
        return {"direction_convention": "outward_normal", "grasps": []}
    if rows.shape[1] != SUCTION_COLUMNS:
        raise GraspListError(f"{source}: suction has 7 columns (got {rows.shape[1]})")
    first, second = rows[:, 1:4], rows[:, 4:7]
    if order == "auto":
        order = _suction_order(first, second, source)
    normals, points = (first, second) if order == "normal-first" else (second, first)
    grasps = [
        {"position": point, "direction": normal, "score": score}
        for point, normal, score in zip(
            points.tolist(), normals.tolist(), rows[:, 0].tolist(), strict=True
        )
    ]
    return {"direction_convention": "outward_normal", "grasps": grasps}


def _suction_order(first: FloatArray, second: FloatArray, source: str) -> str:
    known = np.isfinite(np.hstack([first, second])).all(axis=1)
    unit = [
        bool(np.all(np.abs(np.linalg.norm(rows, axis=1) - 1.0) < UNIT_TOLERANCE))
        for rows in (first[known], second[known])
    ]
    if unit[0] != unit[1]:
        return "normal-first" if unit[0] else "point-first"
    state = "both of" if unit[0] else "neither of"
    raise GraspListError(
        f"{source}: {state} the columns 1–3 and 4–6 are unit normals in every row; say "
        "which are with --from suction-normal-first or --from suction-point-first"
    )
