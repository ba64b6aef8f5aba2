"""Reading HDF5 images in isolation from this process.

The HDF5 library trusts what it reads: on an image with a few wrong bits it can loop for
ever, or crash. A seal finds damage, but not a forgery with a fitting seal. So an image
is read in a copy of this process with a limit on its time, which hands the result
back. Where this process cannot be copied (other threads run in it, or the system is not
Linux), an image without a seal is first tried out in a new process, which takes longer.
"""

from __future__ import annotations

import faulthandler
import os
import pickle
import resource
import signal
import sys
import threading
import warnings
from array import array
from collections.abc import Callable
from contextlib import suppress
from typing import Any, NoReturn, TypeVar

from reachmap.maps.bytes.hdf5 import StructureError
from reachmap.maps.bytes.integrity import reason_against

Found = TypeVar("Found")

CPU_LIMIT_S = 2.0
"""Time that reading may take [s]; a map of 3 MB takes 0.1 s."""

SECONDS_PER_BYTE = 0.5e-6
"""More time for larger images; unpacking takes a twentieth of it."""

ALIGNMENT = 64
MAX_COPIED_BYTES = 512 * 2**20
"""Images larger than this are not worth a second copy of what is in them."""


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
        return _in_copy(function, image)
    if not trusted and (reason := reason_against(image)):
        raise StructureError(reason)
    return function(image)


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
        _write(found, answer)
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
