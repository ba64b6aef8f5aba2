"""File-system queries for names given by users.

``Path.exists`` and others raise for names that are too long, in folders without
permission, and for links to themselves; for a user such files do not exist.
"""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

Given = TypeVar("Given")

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def is_there(path: Path) -> bool:
    """Whether anything of that name exists and is accessible."""
    return os.path.exists(path)  # noqa: PTH110


def is_file(path: Path) -> bool:
    """Whether an accessible file of that name exists."""
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: Path) -> bool:
    """Whether an accessible folder of that name exists."""
    return os.path.isdir(path)  # noqa: PTH112


def is_hdf5(path: Path) -> bool:
    """Whether a regular file begins as HDF5 does; one that cannot be read does not."""
    try:
        if not is_file(path):
            return False
        with path.open("rb") as stream:
            return stream.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE
    except (OSError, ValueError):
        return False


def real_path(path: Path | str) -> Path:
    """Absolute path without symbolic links, as far as they lead anywhere."""
    return Path(os.path.realpath(path))


def recorded_name(name: str) -> str:
    r"""Spell a name from the system as text that can be stored: UTF-8, as it mostly is.

    Python hands over bytes that its locale cannot decode as lone surrogates. Those
    that are UTF-8 are decoded, others are shown as ``\xff``.

    Examples
    --------
    >>> recorded_name("bin.h5"), recorded_name("\udcff")
    ('bin.h5', '\\xff')
    """
    try:
        return os.fsencode(name).decode("utf-8", "backslashreplace")
    except UnicodeEncodeError:
        return name.encode("utf-8", "backslashreplace").decode()


def is_text(name: str) -> bool:
    """Whether a name is text that can be stored: its bytes are UTF-8."""
    try:
        os.fsencode(name).decode()
    except UnicodeError:
        # The locale cannot spell it, which does not keep it from being stored.
        return not any("\ud800" <= letter <= "\udfff" for letter in name)
    return True


def read_up_to(path: Path | str, limit: int) -> bytes | None:
    """Contents of a file or a pipe; None if it exceeds the limit.

    Raises
    ------
    OSError
        It cannot be read, or is a device, which may have no end.
    """
    found = os.stat(path)  # noqa: PTH116
    if stat.S_ISCHR(found.st_mode) or stat.S_ISBLK(found.st_mode):
        raise OSError(errno.EINVAL, "is a device")
    if found.st_size > limit:
        return None
    with Path(path).open("rb") as stream:  # a pipe does not say how long it is
        data = stream.read(limit + 1)
    return data if len(data) <= limit else None


def one_or_more(given: Iterable[Given]) -> tuple[Given, ...]:
    """Items of a collection; a single text or path is one, not its letters."""
    items: Any = (given,) if isinstance(given, (str, os.PathLike)) else given
    return tuple(items)


def as_path(name: str | Path | None) -> Path | None:
    """Path of a name; None stays None."""
    return None if name is None else Path(name)
