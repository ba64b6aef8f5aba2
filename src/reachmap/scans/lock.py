"""One run per output: a lock that the kernel gives back when its owner dies."""

from __future__ import annotations

import errno
import fcntl
import logging
import os
from pathlib import Path

from reachmap.errors import OutputError

NO_LOCKS = frozenset({errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS})

log = logging.getLogger(__name__)


def open_locked(path: Path) -> int:
    """Open or create a file that nobody else has open this way.

    Parameters
    ----------
    path : Path

    Returns
    -------
    int
        Descriptor for reading and writing; closing it gives the lock back, and so
        does the end of the process, however it ends.

    Raises
    ------
    OutputError
        When another process has it, or it cannot be opened.
    """
    while True:
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise OutputError(f"{path}: {error.strerror}") from error
        try:
            _lock(path, descriptor)
            # The run that held the lock may just have removed the file.
            if os.path.samestat(os.fstat(descriptor), path.stat()):
                return descriptor
        except FileNotFoundError:
            pass
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _lock(path: Path, descriptor: int) -> None:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OutputError(
            f"{path} is being written by another run: wait for it, or choose "
            "another output"
        ) from None
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise OutputError(f"{path}: {error.strerror}") from error
        log.warning("%s: this file system has no locks; run one scan at a time", path)
