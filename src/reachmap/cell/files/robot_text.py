"""Text of a robot description: URDF or SRDF, xacro expanded; other formats refused.

XML in robot descriptions does not always follow the standard. It is read as ROS reads
it: a byte order mark, blanks or comments before the declaration, encodings other than
UTF-8 where the declaration names them, prefixes that nobody bound
(``<sensor:camera>``), and document types. Entities are refused.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from reachmap.cell.files.resources import Resolver
from reachmap.cell.files.xacro import Expansion, expand_xacro
from reachmap.cell.text.yaml_reader import read_bytes
from reachmap.errors import CellError

# A choice against hostile input: the largest URDF of example-robot-data has 0.2 MB.
MAX_URDF_BYTES = 20_000_000
DEFINITIONS = ("xacro:arg", "xacro:property", "xacro:macro")
# Suffixes of files that people take for robot descriptions, and what they are.
OTHER_FILES = {
    ".usd": "USD",
    ".usda": "USD",
    ".usdc": "USD",
    ".usdz": "USD",
    ".sdf": "SDF",
    ".world": "SDF",
    ".mjcf": "MJCF",
    ".mjb": "MJCF",
    ".gltf": "glTF",
    ".glb": "glTF",
    ".step": "STEP",
    ".stp": "STEP",
    ".stl": "a mesh",
    ".dae": "a mesh",
    ".obj": "a mesh",
    ".ply": "a mesh",
    ".proto": "a Webots PROTO",
    ".zip": "an archive",
}

# A choice against hostile input: the same URDF has 3,900 elements.
MAX_ELEMENTS = 200_000
_BOMS = (
    (b"\xef\xbb\xbf", "utf-8"),
    (b"\xff\xfe", "utf-16-le"),
    (b"\xfe\xff", "utf-16-be"),
)
_ENCODING = re.compile(rb"""<\?xml[^>]*?\sencoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")
_BLANK = re.compile(rb"\s*")
_DECLARED = re.compile(r"""^(<\?xml[^>]*?)\sencoding\s*=\s*["'][^"']*["']""")


def robot_text(
    path: Path, arguments: Mapping[str, str], resolver: Resolver
) -> Expansion:
    """Text of a URDF or SRDF file, xacro expanded.

    Raises
    ------
    CellError
        The file is of another kind, cannot be read, or does not expand.
    """
    kind = OTHER_FILES.get(path.suffix.lower())
    if kind is not None:
        raise CellError(
            f"{path}: {kind} is not read; export the robot as URDF from the tool that "
            "made it, or take the maker's URDF or xacro"
        )
    if path.suffix == ".xacro":
        return expand_xacro(path, arguments, resolver)
    text = read_xml(path, limit=MAX_URDF_BYTES)
    if "<xacro:" in text or "${" in text:
        _refuse_xacro(text, path)
    return Expansion(text=text, arguments=(), packages={}, warnings=())


def _refuse_xacro(text: str, path: Path) -> None:
    """Refuse a text that needs xacro; macro definitions alone are harmless."""
    todo = [parse_xml(text, path.name)]
    while todo:
        element = todo.pop()
        if element.tag in DEFINITIONS:
            continue
        todo += element
        found = [
            f"{value[:40]!r}" for value in element.attrib.values() if "${" in value
        ]
        if element.tag.startswith("xacro:"):
            found.insert(0, f"<{element.tag}>")
        if found:
            raise CellError(
                f"{path}: has {found[0]}, which xacro must expand; rename the file to "
                f"{path.name}.xacro"
            )


def read_xml(path: Path, *, limit: int) -> str:
    """Text of an XML file, ready for readers that know UTF-8 and no document types.

    Raises
    ------
    CellError
        The file cannot be read, or is not text in the encoding it declares.
    """
    data = read_bytes(path, limit=limit)
    start, encoding = next(
        ((len(bom), name) for bom, name in _BOMS if data.startswith(bom)), (0, "")
    )
    start = _declaration(data, start)
    declared = _ENCODING.match(data, start)
    encoding = encoding or (declared[1].decode() if declared else "utf-8")
    try:
        text = data[start:].decode(encoding)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, start + error.start) + 1
        hint = "" if declared else "; another encoding must be declared in <?xml …?>"
        raise CellError(
            f"{path}:{line}:1: expected {encoding.upper()} text "
            f"(got byte 0x{data[start + error.start]:02x}){hint}"
        ) from None
    except (LookupError, UnicodeError):
        raise CellError(f"{path}:1:1: unknown encoding {encoding!r}") from None
    text = text.lstrip()
    if encoding.lower() not in ("utf-8", "us-ascii", "ascii"):
        text = _DECLARED.sub(r"\1", text)
    return _without_document_type(text) if "<!DOCTYPE" in text else text


def _declaration(data: bytes, start: int) -> int:
    """Where the declaration begins, after blanks and comments; else ``start``."""
    place = start
    while (blank := _BLANK.match(data, place)) is not None:
        place = blank.end()
        end = data.find(b"-->", place) if data.startswith(b"<!--", place) else -1
        if end < 0:
            break
        place = end + len(b"-->")
    return place if data.startswith(b"<?xml", place) else start


def parse_xml(text: str, label: str) -> ElementTree.Element:
    """Parse XML; names keep their prefixes, and nothing is looked up elsewhere.

    Raises
    ------
    CellError
        The text is not XML, declares or uses entities, or is too large.
    """
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data

    def refuse(*_: object) -> NoReturn:
        raise CellError(
            f"{label}: document type declarations with entities (&name;) are not "
            "accepted; write their text in place"
        )

    parser.EntityDeclHandler = refuse
    parser.SkippedEntityHandler = refuse
    try:
        parser.Parse(text.lstrip().encode("utf-8"), True)
        root = builder.close()
    except expat.ExpatError as error:
        line = error.lineno + text[: len(text) - len(text.lstrip())].count("\n")
        reason = expat.errors.messages.get(error.code, str(error))
        raise CellError(
            f"{label}:{line}:{error.offset + 1}: not valid XML: {reason}"
        ) from None
    except UnicodeEncodeError as error:
        raise CellError(f"{label}: not valid XML: {error}") from None
    if sum(1 for _ in root.iter()) > MAX_ELEMENTS:
        raise CellError(f"{label}: more than {MAX_ELEMENTS:,} XML elements")
    return root


def _without_document_type(text: str) -> str:
    """Cut the document type out, which engines do not read; bad XML stays as it is."""
    data, span = text.encode("utf-8"), [0, 0]
    parser = expat.ParserCreate("utf-8")

    def begin(*_: object) -> None:
        span[0] = data.rfind(b"<!DOCTYPE", 0, parser.CurrentByteIndex)

    def end() -> None:
        span[1] = parser.CurrentByteIndex + 1

    def declared(*_: object) -> NoReturn:
        raise ValueError("entities stay, to be refused by the parser")

    parser.StartDoctypeDeclHandler = begin
    parser.EndDoctypeDeclHandler = end
    parser.EntityDeclHandler = declared
    parser.SkippedEntityHandler = declared
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, ValueError):
        return text
    return (data[: span[0]] + data[span[1] :].lstrip()).decode("utf-8").lstrip()
