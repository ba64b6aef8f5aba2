"""Grasp lists: read in any known format, and checked, with every mistake named.

The format is detected from the content, not from the name.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from reachmap.disk import recorded_name
from reachmap.errors import GraspListError, SettingsError
from reachmap.ranking.lists.arrays import GraspList, arrays_from_document
from reachmap.ranking.lists.document import FORMAT, check_document
from reachmap.ranking.lists.fields import NUMBER_KEYS, POSE_KEYS, Findings, shown
from reachmap.ranking.lists.importers.arrays import (
    array_from_npy,
    array_from_npz,
    document_from_graspnet,
    document_from_suction,
)
from reachmap.ranking.lists.importers.graspgen import document_from_graspgen
from reachmap.ranking.lists.importers.isaac import data_from_yaml, document_from_isaac
from reachmap.ranking.lists.json_text import (
    JsonPath,
    dotted,
    limited,
    lines_of,
    parse_json,
)
from reachmap.ranking.lookup.settings import Invalid

STDIN: Final = "-"
# A choice against hostile input: room for MAX_GRASPS at 1,000 bytes each, which is more
# than a ranked grasp takes.
MAX_BYTES: Final = 96 * 2**20

COMPRESSED: Final = {
    b"\x1f\x8b": "gzip",
    b"BZh": "bzip2",
    b"\xfd7zXZ": "xz",
    b"\x28\xb5\x2f\xfd": "zstd",
}
"""First bytes of files to the program that packs them."""

NATIVE: Final = "reachmap"
UNNAMED: Final = "given"
"""Frame of an imported list whose pose is known and whose name is not."""

_ARRAYS: Final[Mapping[str, Callable[..., dict[str, Any]]]] = {
    "graspnet": document_from_graspnet,
    "suction": document_from_suction,
    "suction-normal-first": partial(document_from_suction, order="normal-first"),
    "suction-point-first": partial(document_from_suction, order="point-first"),
}

FORMATS: Final = (NATIVE, "isaac_grasp", "graspgen", *_ARRAYS)


def read_grasps(
    path: str | Path,
    *,
    source_format: str | None = None,
    frame: str | None = None,
    frame_is_posed: bool = False,
    approach_axis: str | None = None,
    invalid: Invalid = "raise",
) -> GraspList:
    """Read a grasp list in any known format.

    Parameters
    ----------
    path : str or Path
        A file, or ``-`` for standard input.
    source_format : str, optional
        One of :data:`FORMATS`; the content decides by default.
    frame : str, optional
        Frame of an imported list; native documents name their own.
    frame_is_posed : bool
        Whether the pose of that frame is known apart from the list: it needs no name
        then, and is called ``given``.
    approach_axis : str, optional
        Approach axis of an imported list's orientations, instead of its format's.
    invalid : {"raise", "mark"}
        What becomes of positions and orientations that are none (NaN, a direction of
        length 0, a matrix that is no rotation): a mistake, or a grasp that is ranked as
        ``invalid``.

    Raises
    ------
    GraspListError
        The file cannot be read, or it holds mistakes: one line each.
    """
    source = "standard input" if str(path) == STDIN else recorded_name(str(path))
    if source_format is not None and source_format not in FORMATS:
        raise SettingsError(f"unknown format {source_format!r}: {', '.join(FORMATS)}")
    data = _read_bytes(path, source)
    document, name, text, notes = document_from_bytes(
        data, source, source_format, finite=invalid == "raise"
    )
    if name == NATIVE:
        _refuse_overrides(document, frame, approach_axis, source)
    else:
        frame = frame or (UNNAMED if frame_is_posed else None)
        document = _imported(document, name, source, frame, approach_axis)
    return grasps_from_document(
        document, source=source, text=text, notes=notes, invalid=invalid
    )


def grasps_from_document(
    document: Any,
    *,
    source: str = "grasps",
    text: str = "",
    notes: Sequence[str] = (),
    invalid: Invalid = "raise",
) -> GraspList:
    """Check a native document and convert it to arrays.

    Parameters
    ----------
    document : object
        A parsed ``reachmap.grasps`` 1.x document.
    source : str
        Name in messages.
    text : str
        The JSON text, for line numbers in messages.
    notes : sequence of str
        Warnings to carry on.
    invalid : {"raise", "mark"}
        See :func:`read_grasps`.

    Raises
    ------
    GraspListError
        Every mistake on a line of its own.
    """
    found = check_document(document)
    rows = _without_a_pose(found) if invalid == "mark" else None
    bad = [one for one in found.mistakes if _is_of_a_row(one[0], rows or ())]
    if len(bad) < len(found.mistakes):
        raise GraspListError(limited(_located(found.mistakes, source, text)))
    located = limited(_located([*bad, *found.warnings], source, text))
    prefix = f"{source}: "
    warnings = [*(prefix + note for note in notes), *located]
    return arrays_from_document(_without_results(document), source, warnings, rows)


def _without_a_pose(found: Findings) -> set[str | int]:
    """Grasps whose position or orientation is none, which makes them invalid."""
    places = [path for path, _ in found.mistakes if path[:1] == ("grasps",)]
    return {path[1] for path in places if len(path) > 2 and path[2] in POSE_KEYS}


def _is_of_a_row(path: JsonPath, rows: Collection[str | int]) -> bool:
    """Whether a mistake is in the numbers of one of some grasps."""
    at = path[:1] == ("grasps",) and len(path) > 2 and path[1] in rows
    return at and path[2] in NUMBER_KEYS


def _read_bytes(path: str | Path, source: str) -> bytes:
    try:
        if str(path) == STDIN:
            data = sys.stdin.buffer.read(MAX_BYTES + 1)
        else:
            with Path(path).open("rb") as stream:
                data = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise GraspListError(f"{source}: cannot be read: {reason}") from None
    if len(data) > MAX_BYTES:
        raise GraspListError(f"{source}: larger than {MAX_BYTES // 2**20} MiB")
    return data


def _refuse_overrides(
    document: Any, frame: str | None, approach_axis: str | None, source: str
) -> None:
    # What is not such a document, or lacks its frame, is reported when it is checked.
    own = document if isinstance(document, dict) else {}
    stated = (
        ("frame", own.get("frame", frame), frame),
        ("approach_axis", own.get("approach_axis", "+z"), approach_axis),
    )
    for name, value, wanted in stated:
        if wanted is not None and value != wanted:
            raise SettingsError(
                f"{source}: a {FORMAT} document states its own {name} "
                f"({shown(value)}); another may be given for imported lists only"
            )


def _imported(
    document: dict[str, Any],
    name: str,
    source: str,
    frame: str | None,
    approach_axis: str | None,
) -> dict[str, Any]:
    if frame is None:
        raise GraspListError(
            f"{source}: a list of the format {name} does not name a frame of the cell: "
            "say with --frame which one its poses are in (bin, robot_base, world, …)"
        )
    if approach_axis is not None:
        if "approach_axis" not in document:
            raise SettingsError(
                f"{source}: a list of the format {name} gives directions, to which "
                f"{approach_axis} as the approach axis says nothing"
            )
        document = {**document, "approach_axis": approach_axis}
    header = {"format": FORMAT, "format_version": "1.0", "frame": frame}
    origin = {**document.get("source", {}), "imported_from": name}
    return {**header, **document, "source": origin}


def _located(
    problems: Sequence[tuple[JsonPath, str]], source: str, text: str
) -> list[str]:
    lines = lines_of(text, (path for path, _ in problems[:50])) if text else {}
    located = []
    for path, message in problems:
        where = f"{source}:{lines[path]}" if path in lines else source
        located.append(f"{where}: {dotted(path)}: {message}")
    return located


def _without_results(document: dict[str, Any]) -> dict[str, Any]:
    clean = {key: value for key, value in document.items() if key != "reachmap"}
    clean["grasps"] = [
        {key: value for key, value in grasp.items() if key != "reachmap"}
        for grasp in document["grasps"]
    ]
    return clean


def document_from_bytes(
    data: bytes, source: str, name: str | None = None, *, finite: bool = True
) -> tuple[Any, str, str, list[str]]:
    """Turn the content of a file into a native document, not yet checked.

    Parameters
    ----------
    data : bytes
    source : str
        Name of the file in messages.
    name : str, optional
        One of :data:`FORMATS`; by default the content decides.
    finite : bool
        Whether NaN in a JSON text or in an array is refused.

    Returns
    -------
    document : object
    name : str
        The format it was read as.
    text : str
        JSON text of a native document, "" otherwise.
    notes : list of str
        What a user should know about the conversion.
    """
    if not data.strip():
        raise GraspListError(f"{source}: the file is empty")
    if data.startswith((b"\x93NUMPY", b"PK\x03\x04")):
        return _from_array(data, source, name, finite=finite)
    text = _text(data, source)
    is_json = text.lstrip().startswith(("{", "["))
    content = (
        parse_json(text, source, finite=finite)
        if is_json
        else data_from_yaml(text, source)
    )
    name = name or _format_of(content, is_json=is_json, source=source)
    if name == "isaac_grasp":
        return document_from_isaac(content, source), name, "", []
    if name == "graspgen":
        document, notes = document_from_graspgen(content, source)
        return document, name, "", notes
    if name == NATIVE and is_json:
        return content, name, text, []
    raise GraspListError(f"{source}: the content is not of the format {name}")


def _from_array(
    data: bytes, source: str, name: str | None, *, finite: bool
) -> tuple[Any, str, str, list[str]]:
    read = array_from_npy if data.startswith(b"\x93") else array_from_npz
    rows = read(data, source, finite=finite)
    name = name or ("graspnet" if rows.shape[1] == 17 else "suction")
    if name not in _ARRAYS:
        raise GraspListError(f"{source}: an array cannot be of the format {name}")
    return _ARRAYS[name](rows, source), name, "", []


def _text(data: bytes, source: str) -> str:
    for magic, packer in COMPRESSED.items():
        if data.startswith(magic):
            raise GraspListError(f"{source}: is compressed ({packer}); unpack it first")
    if data.startswith(b"\x89HDF"):
        raise GraspListError(
            f"{source}: this is an HDF5 file, a map perhaps; not grasps"
        )
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise GraspListError(
            f"{source}: neither text (UTF-8) nor an array: byte {error.start} is "
            f"0x{data[error.start]:02x}"
        ) from None


def _format_of(content: Any, *, is_json: bool, source: str) -> str:
    if isinstance(content, dict):
        if content.get("format") == "isaac_grasp":
            return "isaac_grasp"
        body = content.get("grasps")
        if isinstance(body, dict) and "transforms" in body:
            return "graspgen"
    if is_json:
        return NATIVE
    raise GraspListError(
        f"{source}: not a grasp list; recognised are reachmap.grasps JSON, isaac_grasp "
        "YAML, GraspGen JSON, and arrays (.npy, .npz) with 17 or 7 columns"
    )
