"""Artefacts on disk: written whole or not at all, read checked or not at all.

The seal is a checksum of the bytes, appended to the HDF5 data. The HDF5 library trusts
what it reads: on a file with a few flipped bits it can loop for ever. So no artefact is
handed to it before its bytes have been compared with the seal. Readers of HDF5 ignore
what follows the end of the file that the superblock names; a program that opens the
file for writing cuts the seal off.
"""

from __future__ import annotations

import dataclasses
import hashlib
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np

from reachmap.disk import HDF5_SIGNATURE, read_up_to
from reachmap.errors import EngineError, MapFileError, ReachmapError
from reachmap.maps.bytes.hdf5 import (
    MAX_BYTES,
    StructureError,
    identity_from_image,
    image_from_tree,
    tree_from_image,
)
from reachmap.maps.bytes.isolation import (
    is_open_for_writing,
    isolated,
    named_size,
)
from reachmap.maps.bytes.publish import publish, reason_of
from reachmap.maps.bytes.tree import Leaf, Tree, content_sha256, integrity_sha256
from reachmap.maps.format.checks import check_ranges, check_structure
from reachmap.maps.format.layout import (
    FORMAT_VERSION,
    KINDS,
    Layout,
    kind_of_format,
)

OPEN_ELSEWHERE = (
    "open for writing in another program, or left open by one that crashed; close it "
    "there and try again"
)
MAX_PROBLEMS = 8
"""Mistakes of one file that are listed before the rest is only counted."""

_PREFIX = b"\nreachmap-seal sha256 "
_PATTERN = re.compile(re.escape(_PREFIX) + rb"([0-9a-f]{64})\n\Z")
# The hash as 64 hexadecimal digits, and a line feed.
SEAL_BYTES = len(_PREFIX) + 65

Record = TypeVar("Record")


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class RecordFile(Generic[Record]):
    """Records of one kind as files.

    Parameters
    ----------
    layout : Layout
    to_tree : callable
        Everything that the file of a record holds.
    from_tree : callable
        The record of a checked tree; the path is named in messages.
    """

    layout: Layout
    to_tree: Callable[[Record], Tree]
    from_tree: Callable[[Tree, Path], Record]

    def write(self, path: Path, record: Record, overwrite: bool = False) -> str:
        """Write a record.

        Parameters
        ----------
        path : Path
        record : WorkspaceMap, BinMap, BinPlacement, …
            Its ``stamp.content_sha256`` is not used: it is computed from the numbers.
        overwrite : bool
            Whether an existing file may be replaced.

        Returns
        -------
        str
            ``content_sha256``.

        Raises
        ------
        OutputError
            The file exists, or nothing can be written there.
        EngineError
            The record breaks the format.
        """
        return store(path, self.to_tree(record), self.layout, overwrite=overwrite)

    def read(self, path: Path) -> Record:
        """Read a record; everything about it is checked.

        Raises
        ------
        MapFileError
            The file is missing, damaged, or something else.
        """
        tree, _ = load(path, self.layout)
        return self.from_tree(tree, path)


def store(path: Path, tree: Tree, layout: Layout, *, overwrite: bool = False) -> str:
    """Check an artefact against its own format and put it in place.

    Returns
    -------
    str
        Its ``content_sha256``.

    Raises
    ------
    EngineError
        It breaks its format: a defect of the producer, nothing is written.
    OutputError
        It cannot be written there.
    """
    problems = check_tree(tree, layout)
    if problems:
        raise EngineError(f"{path}: not written, {text}" for text in _listed(problems))
    image = image_from_tree(tree)
    publish(path, [image, seal(image)], overwrite=overwrite)
    return str(tree.attributes["content_sha256"])


def load(path: Path, *layouts: Layout) -> tuple[Tree, Layout]:
    """Read an artefact, checked from its bytes up to the consistency of its numbers.

    Parameters
    ----------
    path : Path
    *layouts : Layout
        What is expected: one of these.

    Raises
    ------
    MapFileError
        The file is missing, damaged, of another kind, of a newer major version or
        not an artefact at all.
    """
    image, intact = read_image(path, layouts)
    try:
        identity, tree = isolated(_read, image, trusted=intact)
    except StructureError as error:
        raise _damaged(path, image, str(error), layouts) from error
    if "format" not in identity and is_open_for_writing(path, image):
        raise MapFileError(f"{path}: {OPEN_ELSEWHERE}")
    found = identify(path, identity, layouts)
    problems = check_hashes(tree)[:1]
    if not problems:
        tree = _upgraded(tree)
        problems = check_tree(tree, found)
    if problems and is_open_for_writing(path, image):
        raise MapFileError(f"{path}: {OPEN_ELSEWHERE}")
    if problems:
        raise MapFileError(
            f"{path}: damaged {found.name}, {text}; `{found.command}` makes a new one"
            for text in _listed(problems)
        )
    return tree, found


def _read(image: bytes) -> tuple[dict[str, str], Tree]:
    """Identify an image, and read it if it is an artefact."""
    identity = identity_from_image(image)
    is_ours = kind_of_format(identity.get("format")) is not None
    return identity, tree_from_image(image) if is_ours else Tree()


def _upgraded(tree: Tree) -> Tree:
    """A tree of version 1.0 converted to version 1.1; any other unchanged.

    Joints were counted instead of named, and the dimensions of cubes were called like
    those of the root. Nothing else changed its form.
    """
    if tree.attributes.get("format_version") != "1.0":
        return tree
    leaves = dict(tree.leaves)
    joint = leaves.get("joint")
    if joint is not None and joint.dims == ("joint",):
        names = np.array(joint.attributes.get("joint_names", ()), str)
        leaves["joint"] = dataclasses.replace(joint, value=names)
    for path, leaf in tree.leaves.items():
        if path.startswith("cubes/"):
            leaves.update(_renamed(path, leaf))
    return dataclasses.replace(tree, leaves=leaves)


def _renamed(path: str, leaf: Leaf) -> dict[str, Leaf]:
    dims = tuple(
        f"cube_{name}" if name in ("x", "y", "z") else name for name in leaf.dims
    )
    group, _, name = path.rpartition("/")
    if leaf.dims != (name,) or name == dims[0]:
        return {path: dataclasses.replace(leaf, dims=dims)}
    return {
        path: dataclasses.replace(leaf, is_hidden=True),
        f"{group}/cube_{name}": dataclasses.replace(leaf, dims=dims),
    }


def check_tree(tree: Tree, layout: Layout) -> list[str]:
    """Check structure, then ranges, then the consistency of the numbers."""
    # Only numbers that are in their ranges can be checked for consistency.
    return (
        check_structure(tree, layout)
        or check_ranges(tree, layout)
        or layout.check(tree)
    )


def check_hashes(tree: Tree) -> list[str]:
    """Compare both checksums with the contents."""
    problems = []
    if tree.attributes.get("content_sha256") != content_sha256(tree):
        problems.append("its content does not match content_sha256")
    if tree.attributes.get("integrity_sha256") != integrity_sha256(tree):
        problems.append("it was changed after it was written (integrity_sha256)")
    return problems


def read_image(path: Path, layouts: Sequence[Layout] = ()) -> tuple[bytes, bool]:
    """Read a file as an HDF5 image whose bytes are intact.

    Returns
    -------
    image : bytes
    intact : bool
        Whether it has a seal, which then fits.
    """
    image, intact = unseal(read_bytes(path, layouts))
    if not image.startswith(HDF5_SIGNATURE):
        raise MapFileError(f"{path}: {_foreign(image)}; {_expected(layouts)}")
    if intact is False:
        raise _damaged(path, image, "its bytes do not match its seal", layouts)
    size = named_size(image)
    if not intact and (size is None or len(image) < size):
        left = f"{len(image)} of {size or 'at least 48'} bytes are left"
        raise _damaged(path, image, left, layouts)
    return image, bool(intact)


def _damaged(
    path: Path, image: bytes, reason: str, layouts: Sequence[Layout]
) -> MapFileError:
    """Describe what is wrong with the bytes of an image."""
    if is_open_for_writing(path, image):
        return MapFileError(f"{path}: {OPEN_ELSEWHERE}")
    return MapFileError(f"{path}: damaged, {reason}; {_expected(layouts)}")


def read_bytes(path: Path, layouts: Sequence[Layout] = ()) -> bytes:
    """Read a file; failures get messages that a user can act on."""
    try:
        data = read_up_to(path, MAX_BYTES)
    except FileNotFoundError as error:
        raise MapFileError(f"{path}: no such file; {_expected(layouts)}") from error
    except OSError as error:
        raise MapFileError(f"{path}: cannot be read ({reason_of(error)})") from error
    if data is None:
        raise MapFileError(f"{path}: larger than {MAX_BYTES >> 30} GiB")
    return data


def is_sealed(path: Path) -> bool:
    """Whether a file still carries the seal it was written with, and it fits."""
    return unseal(read_bytes(path))[1] is True


def artefact_kind(path: Path) -> str | None:
    """Kind of an artefact, as in ``"bin_map"``; None for anything else.

    Never raises. Only the seal and the root attributes are looked at.
    """
    try:
        image, intact = read_image(Path(path))
        identity = isolated(identity_from_image, image, trusted=intact)
        return kind_of_format(identity.get("format"))
    except (ReachmapError, ValueError, StructureError):
        return None


def identify(
    path: Path, attributes: Mapping[str, object], layouts: Sequence[Layout]
) -> Layout:
    """Say which layout a file follows; refuse other kinds and newer versions."""
    name = attributes.get("format")
    kind = kind_of_format(name)
    if kind is None:
        what = f"of the format {name!r}" if name else "with no format"
        raise MapFileError(f"{path}: an HDF5 file {what}; {_expected(layouts)}")
    found = next((layout for layout in layouts if layout.kind == kind), None)
    if found is None:
        raise MapFileError(
            f"{path}: a {KINDS[kind].name} ({name}), which `{KINDS[kind].command}` "
            f"makes; "
            f"{_expected(layouts)}"
        )
    version = str(attributes.get("format_version"))
    own = FORMAT_VERSION.partition(".")[0]
    if not re.fullmatch(r"[0-9]{1,6}\.[0-9]{1,6}", version):
        raise MapFileError(f"{path}: damaged, its format_version is {version!r}")
    if version.partition(".")[0] != own:
        raise MapFileError(
            f"{path}: a {found.name} of version {version}, but this reachmap reads "
            f"{own}.x; a newer reachmap may read it"
        )
    return found


def _expected(layouts: Sequence[Layout]) -> str:
    if len(layouts) != 1:
        names = ", ".join(kind.name for kind in KINDS.values())
        return f"expected one of reachmap's artefacts: {names}"
    (layout,) = layouts
    return f"expected a {layout.name} ({layout.format}), which `{layout.command}` makes"


def _foreign(data: bytes) -> str:
    """Name the kind of a file that is not HDF5."""
    if not data:
        return "an empty file"
    if re.match(rb"\s*(\{|\[\s*[\[{\"\d-])", data):
        return "looks like JSON, not an HDF5 file"
    if b"\0" not in data[:4096]:
        return "a text, not an HDF5 file"
    return "not an HDF5 file"


def _listed(problems: list[str]) -> list[str]:
    """Keep the first few mistakes, and say how many more there are."""
    shown = problems[:MAX_PROBLEMS]
    rest = len(problems) - len(shown)
    return [*shown, f"and {rest} more mistakes"] if rest else shown


def seal(image: bytes) -> bytes:
    """Make the line that is written behind an HDF5 image."""
    return _PREFIX + hashlib.sha256(image).hexdigest().encode() + b"\n"


def unseal(data: bytes) -> tuple[bytes, bool | None]:
    """Split a file into its HDF5 image and the verdict of its seal.

    Returns
    -------
    image : bytes
    intact : bool or None
        Whether the seal fits the image; None where there is no seal.
    """
    found = _PATTERN.search(data, max(0, len(data) - SEAL_BYTES))
    if found is None:
        return data, None
    image = data[: found.start()]
    return image, hashlib.sha256(image).hexdigest().encode() == found.group(1)
