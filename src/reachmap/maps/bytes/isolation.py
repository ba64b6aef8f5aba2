"""Reading HDF5 images in isolation from this process.

The HDF5 library trusts what it reads: on an image with a few wrong bits it can loop for
ever, or crash. A seal finds damage, but not a forgery with a fitting seal. So an image
is read in a copy of this process with a limit on its time, which hands the result
back. Where this process cannot be copied (other threads run in it, or the system is not
Linux), or the copy may not write what it has read (a limit on the size of files), an
image without a seal is first tried out in a new process, which takes longer.
"""

from __future__ import annotations

import faulthandler
import fcntl
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
import warnings
from array import array
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NoReturn, TypeVar

from reachmap.maps.bytes.hdf5 import (
    StructureError,
    identity_from_image,
    tree_from_image,
)

Found = TypeVar("Found")

CPU_LIMIT_S = 2.0
"""Time that reading may take [s]; a map of 3 MB takes 0.1 s."""

SECONDS_PER_BYTE = 0.5e-6
"""More time for larger images; unpacking takes a twentieth of it."""

# A cache line [bytes]; no element of an array needs more.
ALIGNMENT = 64
MAX_COPIED_BYTES = 512 * 2**20
"""Images larger than this are not worth a second copy of what is in them."""

NO_ROOM = 2
"""Exit status of a copy that has read an image and cannot hand it back."""

# Generous for starting Python on a busy machine.
TIME_LIMIT_S = 15.0


def named_size(image: bytes) -> int | None:
    """Size of an HDF5 image according to its superblock [bytes], None if odd.

    A shorter image was cut off, which is cheaper to see here than by reading it.
    """
    if len(image) < 48:
        return None
    # Place of the end-of-file address, by version of the superblock.
    start = {0: 40, 1: 44, 2: 28, 3: 28}.get(image[8])
    return int.from_bytes(image[start : start + 8], "little") if start else None


def is_open_for_writing(path: Path, image: bytes) -> bool:
    """Whether a program has the file open for writing, by its superblock or its lock.

    A program that crashed leaves a flag behind in the superblock. A file that is new
    has none, but the HDF5 library locks what it writes.
    """
    # Place of the consistency flags, by version of the superblock; bit 0 is writing.
    if len(image) >= 24 and image[11 if image[8] >= 2 else 20] & 1:
        return True
    try:
        with path.open("rb") as stream:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def isolated(
    function: Callable[[bytes], Found], image: bytes, *, trusted: bool
) -> Found:
    """Call a function of an image so that no image can crash or block this process.

    Parameters
    ----------
    function : callable
        Reads the image; may raise StructureError.
    image : bytes
    trusted : bool
        Whether the image has a seal that fits.

    Raises
    ------
    StructureError
        The function raised it, crashed or did not come to an end.
    """
    if _can_copy() and len(image) <= MAX_COPIED_BYTES:
        with suppress(_NoRoomError):
            return _in_copy(function, image)
    if not trusted and (reason := reason_against(image)):
        raise StructureError(reason)
    return function(image)


class _NoRoomError(Exception):
    """There is no room for what a copy has read."""


def _can_copy() -> bool:
    return sys.platform == "linux" and threading.active_count() == 1


def _in_copy(function: Callable[[bytes], Found], image: bytes) -> Found:
    limit_s = CPU_LIMIT_S + SECONDS_PER_BYTE * len(image)
    answer = os.memfd_create("reachmap")
    try:
        with warnings.catch_warnings():
            # Python warns of the idle threads of its numerical libraries.
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            _answer(function, image, answer, limit_s)
        _wait(child)
        found: Found = _result(answer)
        return found
    finally:
        os.close(answer)


def _answer(
    function: Callable[[bytes], Any], image: bytes, answer: int, limit_s: float
) -> NoReturn:
    """Run as the copy: write the result, or why there is none, and exit."""
    try:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        seconds = int(limit_s) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        # What the library says when it crashes is not for the user.
        faulthandler.disable()
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        try:
            found = (function(image), "")
        except StructureError as error:
            found = (None, str(error))
        try:
            _write(found, answer)
        except (OSError, MemoryError):
            os._exit(NO_ROOM)
        os._exit(0)
    finally:
        os._exit(1)


def _wait(child: int) -> None:
    try:
        _, status = os.waitpid(child, 0)
    except BaseException:
        with suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        raise
    if os.waitstatus_to_exitcode(status) == NO_ROOM:
        raise _NoRoomError
    if status != 0:
        raise StructureError("HDF5 cannot read it")


def _write(found: Any, answer: int) -> None:
    """Write a result: the sizes of its parts, then what it is, then its arrays."""
    buffers: list[pickle.PickleBuffer] = []
    parts: list[Any] = [pickle.dumps(found, 5, buffer_callback=buffers.append)]
    parts += [buffer.raw() for buffer in buffers]
    with open(answer, "wb", closefd=False) as stream:
        sizes = array("Q", [len(parts), *(len(part) for part in parts)])
        stream.write(sizes)
        for part in parts:
            stream.write(bytes(-stream.tell() % ALIGNMENT))
            stream.write(part)


def _result(answer: int) -> Any:
    """Read a result; its arrays are views of one buffer, and can be written to."""
    data = memoryview(bytearray(os.fstat(answer).st_size))
    with open(answer, "rb", closefd=False) as stream:
        stream.seek(0)
        stream.readinto(data)
    count = int.from_bytes(data[:8], sys.byteorder)
    parts, at = [], 8 * (count + 1)
    for size in data[8:at].cast("Q"):
        at += -at % ALIGNMENT
        parts.append(data[at : at + size])
        at += size
    found, reason = pickle.loads(parts[0], buffers=parts[1:])
    if reason:
        raise StructureError(reason)
    return found


def reason_against(image: bytes) -> str:
    """Reason not to read an image in this process, found by another one; "" if none."""
    limit_s = TIME_LIMIT_S + SECONDS_PER_BYTE * len(image)
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__],
            input=image,
            capture_output=True,
            timeout=limit_s,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return "HDF5 cannot read it"
    if done.returncode == 0:
        return ""
    return done.stdout.decode(errors="replace").strip() or "HDF5 cannot read it"


def inspect(image: bytes) -> str:
    """Read an image in this process and report what is wrong with it, or ""."""
    try:
        identity = identity_from_image(image)
        # Of a file of another program, nothing more will be read.
        if str(identity.get("format")).startswith("reachmap."):
            tree_from_image(image)
    except StructureError as error:
        return str(error)
    return ""


def main() -> int:
    """Inspect the image on standard input; write what is wrong with it, if anything."""
    reason = inspect(sys.stdin.buffer.read())
    sys.stdout.write(reason)
    return 1 if reason else 0


if __name__ == "__main__":
    sys.exit(main())
