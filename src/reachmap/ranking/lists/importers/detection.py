"""Detection of the format of a grasp list from its content, not its name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from reachmap.errors import GraspListError
from reachmap.ranking.lists.importers.arrays import (
    array_from_npy,
    array_from_npz,
    document_from_graspnet,
    document_from_suction,
)
from reachmap.ranking.lists.importers.graspgen import document_from_graspgen
from reachmap.ranking.lists.importers.isaac import data_from_yaml, document_from_isaac
from reachmap.ranking.lists.json_text import parse_json

NATIVE: Final = "reachmap"

_ARRAYS: Final[Mapping[str, Callable[..., dict[str, Any]]]] = {
    "graspnet": document_from_graspnet,
    "suction": document_from_suction,
    "suction-normal-first": partial(document_from_suction, order="normal-first"),
    "suction-point-first": partial(document_from_suction, order="point-first"),
}

FORMATS: Final = (NATIVE, "isaac_grasp", "graspgen", *_ARRAYS)


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
        Whether NaN in a JSON text is refused.

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
        return _from_array(data, source, name)
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
    data: bytes, source: str, name: str | None
) -> tuple[Any, str, str, list[str]]:
    read = array_from_npy if data.startswith(b"\x93") else array_from_npz
    rows = read(data, source)
    name = name or ("graspnet" if rows.shape[1] == 17 else "suction")
    if name not in _ARRAYS:
        raise GraspListError(f"{source}: an array cannot be of the format {name}")
    return _ARRAYS[name](rows, source), name, "", []


def _text(data: bytes, source: str) -> str:
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
