"""What is on the disk under a name that a user gave.

``Path.exists`` and its kin raise for names that are too long, in folders that may not
be looked into, and for links that lead to themselves; for a user nothing is there.
"""

from __future__ import annotations

import os
from pathlib import Path


def is_there(path: Path) -> bool:
    """Whether something of that name can be seen."""
    return os.path.exists(path)  # noqa: PTH110


def is_file(path: Path) -> bool:
    """Whether a file of that name can be seen."""
    return os.path.isfile(path)  # noqa: PTH113


def is_folder(path: Path) -> bool:
    """Whether a folder of that name can be seen."""
    return os.path.isdir(path)  # noqa: PTH112


def real_path(path: Path | str) -> Path:
    """Absolute path without symbolic links, as far as they lead anywhere."""
    return Path(os.path.realpath(path))
