"""Putting a finished file in place: complete under its name, or not there at all."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable
from pathlib import Path

from reachmap.disk import real_path
from reachmap.errors import OutputError


def check_output(path: Path, *, overwrite: bool = False) -> Path:
    """Refuse a place where nothing could be written, before the work is done.

    Parameters
    ----------
    path : Path
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        The place itself, symbolic links followed.

    Raises
    ------
    OutputError
        The file exists, is a folder, or its folder is missing or read-only.
    """
    target = real_path(path)
    try:
        problem = _obstacle(target, overwrite=overwrite)
    except OSError as error:
        problem = f"cannot be written ({_reason(error)})"
    if problem:
        raise OutputError(f"{path}: {problem}")
    return target


def _obstacle(target: Path, *, overwrite: bool) -> str:
    """Say why nothing can be written there; "" if it can."""
    folder = target.parent
    if target.is_dir():
        return "is a folder; name a file"
    if target.exists() and not overwrite:
        return "exists already; --overwrite replaces it, --output names another file"
    if not folder.is_dir():
        return f"the folder {folder} does not exist"
    if not os.access(folder, os.W_OK | os.X_OK):
        return f"cannot be written (no permission in {folder})"
    return ""


def publish(path: Path, chunks: Iterable[bytes], *, overwrite: bool = False) -> Path:
    """Write a file under a temporary name, flush it to disk, move it into place.

    Parameters
    ----------
    path : Path
    chunks : iterable of bytes
        The contents, in order.
    overwrite : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        Where the file is, symbolic links followed.

    Raises
    ------
    OutputError
        Nothing was written; what stood there before is untouched.
    """
    target = check_output(path, overwrite=overwrite)
    temporary = target.with_name(f"{target.name}.{os.getpid()}.tmp")
    try:
        with temporary.open("wb") as stream:
            for chunk in chunks:
                stream.write(chunk)
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(target)
        sync_folder(target.parent)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({_reason(error)})") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()
    return target


def sync_folder(folder: Path) -> None:
    """Make a rename last through a power cut, where the file system can."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _reason(error: OSError) -> str:
    return error.strerror or type(error).__name__
