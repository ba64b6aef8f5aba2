"""Finding files: ``package://`` names, absolute paths, paths relative to the cell.

A reference is resolved only where the cell says:

- in the cell file: ``package://NAME/…``, an absolute path, ``file://…``, or a path
  relative to the cell's folder;
- in a URDF: ``package://NAME/…`` or a path relative to the URDF's folder, which may
  not climb out of the *root* of the URDF (its package; else the cell's folder if the
  URDF lies in it; else the folder above the URDF's). Absolute paths and ``file://``
  must lie in that root, in the cell's folder or in a package folder.

Packages are looked up in ``resources.packages`` of the cell,
``$REACHMAP_PACKAGE_PATH``, ``$ROS_PACKAGE_PATH``, ``share`` of each entry of
``$AMENT_PREFIX_PATH``, the data of the installed ``example-robot-data`` distribution,
and the cells shipped with reachmap.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import metadata, resources
from pathlib import Path

from reachmap.disk import is_file, is_folder

SCHEME = "package://"
SHIPPED = "reachmap-cells"


class NotFoundError(LookupError):
    """A reference leads to no file; the message lists every place tried."""


def shipped_folder() -> Path:
    """Folder of the cells shipped with reachmap."""
    return Path(str(resources.files("reachmap.cells")))


def data_folder() -> Path | None:
    """``share`` folder of the installed example-robot-data, if there is one."""
    try:
        distribution = metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError:
        return None
    return Path(str(distribution.locate_file("cmeel.prefix/share")))


def search_folders() -> list[Path]:
    """Folders that hold packages, in the order they are tried."""

    def entries(variable: str) -> Iterator[Path]:
        for entry in os.environ.get(variable, "").split(os.pathsep):
            if entry:
                yield Path(entry)

    folders = [*entries("REACHMAP_PACKAGE_PATH"), *entries("ROS_PACKAGE_PATH")]
    folders += [prefix / "share" for prefix in entries("AMENT_PREFIX_PATH")]
    data = data_folder()
    if data is not None:
        folders.append(data)
    return folders


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolver:
    """Turns references into paths of existing files.

    Parameters
    ----------
    directory : Path
        Folder of the cell file.
    packages : mapping
        ``resources.packages`` of the cell: package name to folder.
    """

    directory: Path
    packages: Mapping[str, str] = field(default_factory=dict)

    def package_folders(self, name: str) -> tuple[list[Path], list[Path]]:
        """Existing folders of a package, and all places tried."""
        tried = []
        if name in self.packages:
            tried.append(self.directory / self.packages[name])
        for folder in search_folders():
            tried.append(folder / name)
            # A search path may name the package itself, as ROS 1 allows.
            if folder.name == name:
                tried.append(folder)
        if name == SHIPPED:
            tried.append(shipped_folder())
        return [folder for folder in tried if is_folder(folder)], tried

    def resolve(self, reference: str) -> Path:
        """Absolute path of a file named in the cell file; NotFoundError if none."""
        if reference.startswith(SCHEME):
            return self._in_package(reference)[0]
        path = Path(_without_file_scheme(reference)).expanduser()
        return _existing(reference, [self.directory / path])

    def resolve_robot(self, reference: str) -> tuple[Path, Path]:
        """Path of the URDF, and the root that its relative references stay in."""
        if reference.startswith(SCHEME):
            return self._in_package(reference)
        path = self.resolve(reference)
        folder = _normal(self.directory)
        root = folder if path.is_relative_to(folder) else path.parent.parent
        return path, root

    def resolve_from_urdf(self, reference: str, folder: Path, root: Path) -> Path:
        """Absolute path of a file named in a URDF in ``folder``."""
        if reference.startswith(SCHEME):
            return self._in_package(reference)[0]
        if "://" in reference and not reference.startswith("file://"):
            scheme = reference.split("://")[0]
            raise NotFoundError(
                f"{reference!r}: unknown scheme {scheme[:20]!r} (package:// or file://)"
            )
        path = _normal(folder / _without_file_scheme(reference))
        allowed = [root, self.directory, *search_folders()]
        allowed += [self.directory / folder for folder in self.packages.values()]
        if not any(path.is_relative_to(_normal(place)) for place in allowed):
            raise NotFoundError(
                f"{reference!r}: leads out of {root}; "
                "add its folder to resources.packages"
            )
        return _existing(reference, [path])

    def _in_package(self, reference: str) -> tuple[Path, Path]:
        """File and package folder of a ``package://`` reference."""
        name, _, rest = reference.removeprefix(SCHEME).partition("/")
        if not name or not rest:
            raise NotFoundError(f"{reference!r}: expected package://NAME/PATH")
        folders, tried = self.package_folders(name)
        if not folders:
            places = ", ".join(str(folder) for folder in tried) or "nowhere"
            raise NotFoundError(
                f"package {name!r} of {reference!r} not found (tried {places}); "
                f"{_remedy(name)}"
            )
        candidates = []
        for folder in folders:
            path = _normal(folder / rest)
            if not path.is_relative_to(_normal(folder)):
                raise NotFoundError(f"{reference!r}: leads out of the package")
            candidates.append(path)
        found = _existing(reference, candidates)
        return found, _normal(folders[candidates.index(found)])


def _remedy(name: str) -> str:
    if name == "example-robot-data":
        return "install it with: pip install example-robot-data"
    return "add it to resources.packages of the cell or to $REACHMAP_PACKAGE_PATH"


def _without_file_scheme(reference: str) -> str:
    return reference.removeprefix("file://")


def _normal(path: Path) -> Path:
    # Lexical, not resolve(): a symbolic link inside a package (a ROS workspace
    # built with --symlink-install) is the package's own business.
    return Path(os.path.normpath(Path.cwd() / path))


def _existing(reference: str, candidates: list[Path]) -> Path:
    """First candidate that is a file."""
    paths = [_normal(path) for path in candidates]
    for path in paths:
        if is_file(path):
            return path
    places = ", ".join(str(path) for path in paths)[:4000]
    shown = reference if len(reference) <= 200 else reference[:197] + "…"
    if "\0" in places:
        raise NotFoundError(f"{shown!r}: not a file name")
    raise NotFoundError(f"file {shown!r} not found (tried {places})")
