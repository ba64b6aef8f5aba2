"""Finding files: ``package://`` names, absolute paths, paths relative to the cell.

A reference is resolved only where the cell says:

- in the cell file: ``package://NAME/…``, an absolute path, ``file://…``, or a path
  relative to the cell's folder;
- in a URDF: ``package://NAME/…`` or a path relative to the URDF's folder, which may
  not climb out of the *root* of the URDF (its package; else the cell's folder if the
  URDF lies in it; else the folder above the URDF's). Absolute paths and ``file://``
  must lie in that root, in the cell's folder or in a package folder.

Packages are looked up in ``resources.packages`` of the cell,
``$REACHMAP_PACKAGE_PATH``, around the URDF (the package it lies in and those beside it,
see :mod:`reachmap.cell.files.packages`), above the cell, in ``$ROS_PACKAGE_PATH``,
``share`` of each entry of ``$AMENT_PREFIX_PATH``, the data of the installed
``example-robot-data`` distribution, and the cells shipped with reachmap.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import metadata, resources
from pathlib import Path
from urllib.parse import unquote

from reachmap.cell.files.packages import (
    LEVELS,
    own_package,
    package_above,
    package_name,
    package_nearby,
)
from reachmap.disk import is_file, is_folder

SCHEME = "package://"
SHIPPED = "reachmap-cells"
# Folders that hold packages in a ROS installation or workspace.
INSTALLED = ("share", "src", "install")


class NotFoundError(LookupError):
    """A referenced file does not exist; the message lists every place tried."""


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
    return [*_own_search_path(), *_ros_search_path()]


def _own_search_path() -> list[Path]:
    return list(_entries("REACHMAP_PACKAGE_PATH"))


def _ros_search_path() -> list[Path]:
    folders = list(_entries("ROS_PACKAGE_PATH"))
    folders += [prefix / "share" for prefix in _entries("AMENT_PREFIX_PATH")]
    data = data_folder()
    return folders if data is None else [*folders, data]


def _entries(variable: str) -> Iterator[Path]:
    for entry in os.environ.get(variable, "").split(os.pathsep):
        if entry:
            yield Path(entry)


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolver:
    """Turns references into paths of existing files.

    Parameters
    ----------
    directory : Path
        Folder of the cell file.
    packages : mapping
        ``resources.packages`` of the cell: package name to folder.
    urdf_folder : Path, optional
        Folder of the URDF, around which packages are looked for, too.
    """

    directory: Path
    packages: Mapping[str, str] = field(default_factory=dict)
    urdf_folder: Path | None = None

    def around(self, urdf: str) -> Resolver:
        """Copy that looks around the URDF, too, if the URDF can be found."""
        try:
            return dataclasses.replace(self, urdf_folder=self.resolve(urdf).parent)
        except NotFoundError:
            return self

    def package_folders(self, name: str) -> tuple[list[Path], list[Path]]:
        """Existing folders of a package, and all places tried."""
        tried = []
        if name in self.packages:
            tried.append(self.directory / self.packages[name])
        tried += _in_folders(name, _own_search_path())
        for place in filter(None, (self.urdf_folder, self.directory)):
            tried += package_above(name, _normal(place))
        tried += _in_folders(name, _ros_search_path())
        if name == SHIPPED:
            tried.append(shipped_folder())
        found = [folder for folder in tried if is_folder(folder)]
        if not found and self.urdf_folder is not None:
            found = package_nearby(name, _normal(self.urdf_folder))
        return found, tried

    def found_by_environment(self, name: str) -> Path | None:
        """Folder of a package that nothing but an environment variable leads to."""
        found, _ = self.package_folders(name)
        above = package_above(name, _normal(self.urdf_folder or self.directory))
        variables = [
            *_entries("REACHMAP_PACKAGE_PATH"),
            *_entries("ROS_PACKAGE_PATH"),
            *(prefix / "share" for prefix in _entries("AMENT_PREFIX_PATH")),
        ]
        named = [*_in_folders(name, variables)]
        if found and found[0] in named and found[0] not in above:
            return _normal(found[0])
        return None

    def resolve(self, reference: str) -> Path:
        """Absolute path of a file named in the cell file; NotFoundError if none."""
        if reference.startswith(SCHEME):
            return self._in_package(reference)[0]
        paths = [Path(text).expanduser() for text in _spellings(reference)]
        return _existing(reference, [self.directory / path for path in paths])

    def resolve_robot(self, reference: str) -> tuple[Path, Path]:
        """Path of the URDF, and the root that its relative references stay in."""
        if reference.startswith(SCHEME):
            return self._in_package(reference)
        path = self.resolve(reference)
        folder = _normal(self.directory)
        above = path.parent.parent
        root = folder if path.is_relative_to(folder) else above
        package = own_package(path.parent)
        # A package far above is a project that holds robots, rather than a robot.
        if (
            package
            and package in path.parents[:LEVELS]
            and root.is_relative_to(package)
        ):
            root = package
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
        paths = [_normal(folder / text) for text in _spellings(reference)]
        paths += [moved for path in paths for moved in self._of_other_machine(path)]
        allowed = [root, self.directory, *search_folders()]
        allowed += [self.directory / folder for folder in self.packages.values()]
        within = [
            path
            for path in paths
            if any(path.is_relative_to(_normal(place)) for place in allowed)
            or self._in_known_package(path)
        ]
        if not within and not any(is_file(path) for path in paths):
            raise NotFoundError(
                f"file {reference!r} not found; if it names the folder of a package on "
                "another machine, say where the package is here: new-cell "
                "--package NAME=FOLDER, or resources.packages of the cell"
            )
        if not within:
            raise NotFoundError(
                f"{reference!r}: points outside {root}; "
                "add its folder to resources.packages"
            )
        return _existing(reference, within)

    def _of_other_machine(self, path: Path) -> list[Path]:
        """Places of a file named by where its package was installed elsewhere.

        URDFs that were expanded from xacro have such names: ``…/share/NAME/meshes/…``.
        """
        if is_file(path) or not path.is_absolute():
            return []
        parts = path.parts
        return [
            _normal(folder.joinpath(*parts[k + 1 :]))
            for k in range(1, len(parts) - 1)
            if parts[k - 1] in INSTALLED
            for folder in self.package_folders(parts[k])[0]
        ]

    def _in_known_package(self, path: Path) -> bool:
        """Whether a path lies in a package that its name leads to, too."""
        package = own_package(path.parent)
        if package is None:
            return False
        found, _ = self.package_folders(package_name(package) or "")
        return package in map(_normal, found)

    def _in_package(self, reference: str) -> tuple[Path, Path]:
        """File and package folder of a ``package://`` reference."""
        # Some write three slashes, or two in a row later on.
        parts = reference.removeprefix(SCHEME).split("/")
        name, _, rest = "/".join(part for part in parts if part).partition("/")
        if not name or not rest:
            raise NotFoundError(f"{reference!r}: expected package://NAME/PATH")
        folders, _ = self.package_folders(name)
        if not folders:
            raise NotFoundError(self.missing_package(name, reference))
        candidates: dict[Path, Path] = {}
        for folder in folders:
            for text in dict.fromkeys((unquote(rest), rest)):
                path = _normal(folder / text)
                if not path.is_relative_to(_normal(folder)):
                    raise NotFoundError(f"{reference!r}: points outside the package")
                candidates.setdefault(path, folder)
        found = _existing(reference, list(candidates))
        return found, _normal(candidates[found])

    def missing_package(self, name: str, reference: str) -> str:
        """Report where a package was searched for, and what to do."""
        _, tried = self.package_folders(name)
        places = ", ".join(str(folder) for folder in tried) or "nowhere"
        return (
            f"package {name!r} of {reference!r} not found (tried {places}); "
            f"{_remedy(name)}"
        )


def _remedy(name: str) -> str:
    if name == "example-robot-data":
        return "install it with: pip install example-robot-data"
    return (
        f"say where it is: {name}: FOLDER in resources.packages of the cell (new-cell "
        f"--package {name}=FOLDER), or its parent in $REACHMAP_PACKAGE_PATH"
    )


def _in_folders(name: str, folders: list[Path]) -> Iterator[Path]:
    for folder in folders:
        yield folder / name
        # A search path may name the package itself, as ROS 1 allows.
        if folder.name == name:
            yield folder


def _spellings(reference: str) -> tuple[str, ...]:
    """Path of a reference; of a file:// one first with percent signs decoded."""
    rest = reference.removeprefix("file://")
    if rest == reference:
        return (reference,)
    rest = rest.removeprefix("localhost") if rest.startswith("localhost/") else rest
    return tuple(dict.fromkeys((unquote(rest), rest)))


def _normal(path: Path) -> Path:
    # Lexical, not resolve(): a symbolic link inside a package (a ROS workspace
    # built with --symlink-install) is the package's own business.
    text = os.path.normpath(Path.cwd() / path)
    # POSIX leaves two leading slashes alone; file:///$(find NAME) makes them.
    return Path("/" + text.lstrip("/") if text.startswith("//") else text)


def _existing(reference: str, candidates: list[Path]) -> Path:
    """First candidate that is a file."""
    paths = list(dict.fromkeys(map(_normal, candidates)))
    for path in paths:
        if is_file(path):
            return path
    places = ", ".join(str(path) for path in paths)[:4000]
    shown = reference if len(reference) <= 200 else reference[:197] + "…"
    if "\0" in places:
        raise NotFoundError(f"{shown!r}: not a file name")
    raise NotFoundError(f"file {shown!r} not found (tried {places})")
