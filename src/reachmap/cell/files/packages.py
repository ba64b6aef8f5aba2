"""ROS packages around a file: its own package, and that package's neighbours.

A package is a folder with ``package.xml`` (or ROS 1's older ``manifest.xml``). Around a
file, a folder of the package's name will do as well: unpacked archives often lack the
rest.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from reachmap.disk import is_file, is_folder

LEVELS = 6  # folders above a file that are looked at: robots/maker/arm/urdf/…
WORKSPACE_LEVELS = 3  # folders above a package: repository, src, workspace
DEPTH = 3  # folders below those
# A choice: a home folder beside the robot must not be searched to its end.
MAX_FOLDERS = 3_000
_NAME = re.compile(rb"<name>\s*([^<\s]+)\s*</name>")


def own_package(folder: Path) -> Path | None:
    """The package that a folder lies in, or None."""
    for place in (folder, *folder.parents):
        if package_name(place) is not None:
            return place
    return None


def package_name(folder: Path) -> str | None:
    """Name of the package whose top folder this is; None if it is none."""
    if is_file(folder / "package.xml"):
        try:
            with (folder / "package.xml").open("rb") as stream:
                found = _NAME.search(stream.read(100_000))
        except OSError:
            return None
        return found[1].decode("utf-8", "replace") if found else folder.name
    return folder.name if is_file(folder / "manifest.xml") else None


def package_above(name: str, folder: Path) -> list[Path]:
    """Folders of a package that a folder lies in or beside, nearest first."""
    found = []
    for place in (folder, *folder.parents)[:LEVELS]:
        if place == place.parent:
            break
        if name in (place.name, package_name(place)):
            found.append(place)
        elif is_folder(place / name):
            found.append(place / name)
    return found


def package_nearby(name: str, folder: Path) -> list[Path]:
    """Folders of a package in the repository or workspace of another, nearest first."""
    own = own_package(folder)
    start = folder if own is None else own
    for place in start.parents[:WORKSPACE_LEVELS]:
        if place == place.parent:
            break
        found = [f for f in _packages_below(place) if package_name(f) == name]
        if found:
            return found
    return []


def _packages_below(top: Path) -> Iterator[Path]:
    """Packages in a folder, breadth first; what lies inside a package is left out."""
    level, seen = [top], 0
    for _ in range(DEPTH + 1):
        deeper: list[Path] = []
        for folder in level:
            seen += 1
            if seen > MAX_FOLDERS:
                return
            if folder != top and package_name(folder) is not None:
                yield folder
            else:
                deeper.extend(_subfolders(folder))
        level = deeper


def _subfolders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            names = [e.name for e in entries if e.is_dir()]
    except OSError:
        return []
    return [folder / name for name in sorted(names) if not name.startswith(".")]
