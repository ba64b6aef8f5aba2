"""Publishing a finished file atomically: complete under its name, or absent."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import stat
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from reachmap.disk import is_text, is_there, real_path
from reachmap.errors import NoRoomError, OutputError, SettingsError

SUFFIX_BYTES = 24
"""Room that a name must leave for those of its store and of its temporary file."""

NO_ROOM = frozenset({errno.ENOSPC, errno.EFBIG, errno.EDQUOT})
PICTURES = (".png", ".svg")
Identity = list[int]
_ANNOUNCE: ContextVar[Callable[[Identity | None], None] | None] = ContextVar(
    "announce", default=None
)
EXISTS = "exists already; --overwrite replaces it, --output names another file"


def check_output(
    path: Path, *, overwrite: bool = False, inputs: Iterable[str | Path] = ()
) -> Path:
    """Refuse a place where nothing could be written, before the work is done.

    Parameters
    ----------
    path : Path
    overwrite : bool
        Whether an existing file may be replaced.
    inputs : iterable of path
        Files the command reads, which it must not replace; under any name, since
        links, hard or symbolic, lead to the same file. Names of no file are ignored.

    Returns
    -------
    Path
        The place itself, symbolic links followed.

    Raises
    ------
    OutputError
        The file exists, is not a regular file, or is an input, its folder is missing or
        read-only, or its name is one that cannot be stored.
    """
    target = real_path(path)
    try:
        problem = _conflict(target, inputs)
        problem = problem or _obstacle(path, target, overwrite=overwrite)
    except OSError as error:
        problem = f"cannot be written ({reason_of(error)})"
    if problem:
        raise OutputError(f"{path}: {problem}")
    return target


def _obstacle(path: Path, target: Path, *, overwrite: bool) -> str:
    """Reason why nothing can be written there; "" if it can."""
    folder = target.parent
    found = os.stat(path) if is_there(path) else None  # noqa: PTH116
    if found is not None and stat.S_ISDIR(found.st_mode):
        return "is a folder; name a file"
    if found is not None and not stat.S_ISREG(found.st_mode):
        return "is not a regular file (a device, pipe or socket); name a file"
    if found is not None and _is_stream(found):
        return "is where this command's own output goes; name another file"
    if found is not None and not overwrite:
        return EXISTS
    if not folder.is_dir():
        return f"the folder {folder} does not exist"
    if not os.access(folder, os.W_OK | os.X_OK):
        return f"cannot be written (no permission in {folder})"
    return _bad_name(target)


def _bad_name(target: Path) -> str:
    if not is_text(target.name):
        return "the name is not UTF-8 text, and could not be recorded; choose another"
    longest = os.pathconf(target.parent, "PC_NAME_MAX") - SUFFIX_BYTES
    if len(os.fsencode(target.name)) > longest:
        return f"the name is too long; the limit is {longest} bytes"
    return ""


def _is_stream(found: os.stat_result) -> bool:
    """Whether a file is where standard output or error of this process goes."""
    for descriptor in (1, 2):
        with contextlib.suppress(OSError):
            if os.path.samestat(found, os.fstat(descriptor)):
                return True
    return False


def _conflict(target: Path, inputs: Iterable[str | Path]) -> str:
    """Name the input that is the same file as an output; "" if none is."""
    if not is_there(target):
        return ""
    for source in inputs:
        if is_there(Path(source)) and target.samefile(source):
            return f"would replace {source}, which this command reads"
    return ""


def check_outputs(
    outputs: Iterable[Path | None],
    *,
    overwrite: bool,
    inputs: Sequence[str | Path | None] = (),
) -> None:
    """Refuse outputs that cannot be written, that are inputs or that coincide.

    Parameters
    ----------
    outputs : iterable of Path
        None is an output that was not asked for.
    overwrite : bool
    inputs : sequence of path
        What the command reads; None is an input that was not given.

    Raises
    ------
    OutputError
        As :func:`check_output` raises it.
    SettingsError
        Two results would go to one file.
    """
    sources = [source for source in inputs if source is not None]
    seen: dict[Path, Path] = {}
    for output in outputs:
        if output is None:
            continue
        target = check_output(output, overwrite=overwrite, inputs=sources)
        if target in seen:
            raise SettingsError(f"{output}: two results need two files")
        seen[target] = output


def check_picture(path: Path | None, option: str) -> None:
    """Refuse a picture whose suffix is not .png or .svg."""
    if path is not None and path.suffix not in PICTURES:
        raise SettingsError(f"{option} {path}: expected a name in .png or .svg")


def publish(path: Path, chunks: Iterable[bytes], *, overwrite: bool = False) -> Path:
    """Write a file under a temporary name, flush it to disk, move it into place.

    Without ``overwrite`` a file that somebody else has put there since the place was
    checked stays: the new one is linked to its name, which fails where one exists.
    The temporary name is always the same, so that a run that is killed leaves at
    most one such file, which the next one takes over.

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
        Nothing was written; what stood there before is untouched. It is a
        :class:`~reachmap.errors.NoRoomError` where the disk is full.
    """
    target = check_output(path, overwrite=overwrite)
    try:
        with _temporary(target) as (temporary, descriptor):
            with open(descriptor, "wb", closefd=False) as stream:
                for chunk in chunks:
                    stream.write(chunk)
            os.fsync(descriptor)
            if (announce := _ANNOUNCE.get()) is not None:
                announce(identity(temporary))
            if overwrite:
                temporary.replace(target)
            else:
                _link(temporary, target)
        sync_folder(target.parent)
    except OutputError:
        raise
    except FileExistsError:
        raise OutputError(f"{path}: {EXISTS}") from None
    except OSError as error:
        kind = NoRoomError if error.errno in NO_ROOM else OutputError
        raise kind(f"{path}: cannot be written ({reason_of(error)})") from error
    return target


def publish_json(path: Path, value: Any, *, overwrite: bool) -> Path:
    """Write plain values as JSON text; see :func:`publish`."""
    text = json.dumps(value, indent=1, allow_nan=False)
    return publish(path, [text.encode("ascii"), b"\n"], overwrite=overwrite)


def make_folder(path: Path) -> None:
    """Make a folder, and those above it, if it is not there.

    Raises
    ------
    OutputError
        It cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: cannot be made ({reason_of(error)})") from error


@contextlib.contextmanager
def announced(announce: Callable[[Identity | None], None]) -> Iterator[None]:
    """Announce the files that are published in a block before they are moved.

    Parameters
    ----------
    announce : callable
        Gets the identity that a file, complete under its temporary name, will have in
        its place, too.
    """
    token = _ANNOUNCE.set(announce)
    try:
        yield
    finally:
        _ANNOUNCE.reset(token)


def identity(path: Path) -> Identity | None:
    """Identity of the file at a path; None where there is none."""
    if not is_there(path):
        return None
    found = path.stat()
    return [found.st_ino, found.st_size, found.st_mtime_ns]


@contextlib.contextmanager
def _temporary(target: Path) -> Iterator[tuple[Path, int]]:
    """Open the temporary file of a place for this process alone; remove it after."""
    temporary = target.with_name(f"{target.name}.tmp")
    _remove_stale(temporary)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    try:
        descriptor = os.open(temporary, flags, 0o666)
    except FileExistsError:
        raise _busy(temporary) from None
    try:
        # Before it was locked, another run may have taken it for a stale one.
        if not _lock(descriptor) or not _is_same(descriptor, temporary):
            raise _busy(temporary)
        try:
            yield temporary, descriptor
        finally:
            with contextlib.suppress(OSError):
                temporary.unlink()
    finally:
        os.close(descriptor)


def _remove_stale(temporary: Path) -> None:
    """Remove what a killed run left; a file that is being written is refused."""
    try:
        descriptor = os.open(temporary, os.O_WRONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except FileNotFoundError:
        return
    try:
        if not _lock(descriptor):
            raise _busy(temporary)
        if _is_same(descriptor, temporary):
            temporary.unlink()
    finally:
        os.close(descriptor)


def _is_same(descriptor: int, path: Path) -> bool:
    """Whether an open file is still the one of that name."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False


def _lock(descriptor: int) -> bool:
    """Lock a file that nobody else has locked; True also where there are no locks."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass
    return True


def _busy(temporary: Path) -> OutputError:
    return OutputError(f"{temporary}: is being written by another run")


def _link(temporary: Path, target: Path) -> None:
    """Give a file its name; FileExistsError if the name is taken."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise
    except OSError:
        # A file system without links (FAT, some network drives): look, then rename.
        if is_there(target):
            raise FileExistsError from None
        temporary.rename(target)


def sync_folder(folder: Path) -> None:
    """Make a rename survive a power cut, where the file system supports it."""
    with contextlib.suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def reason_of(error: OSError) -> str:
    """Say why the system refused, for a message."""
    return error.strerror or type(error).__name__
