"""Sources of ``new-cell``: URDF, packages, arguments, MoveIt configuration."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from reachmap.cell.files.collisions import mesh_scales
from reachmap.cell.files.moveit_config import find_moveit_config
from reachmap.cell.files.planning_scene import SceneBody, read_scene
from reachmap.cell.files.resources import SCHEME, NotFoundError, Resolver
from reachmap.cell.files.robot_text import robot_text
from reachmap.cell.files.srdf import SrdfDescription, parse_srdf
from reachmap.cell.files.urdf import UrdfDescription, parse_urdf
from reachmap.cell.files.xacro import Expansion
from reachmap.cell.text.messages import did_you_mean
from reachmap.disk import is_folder
from reachmap.errors import SettingsError

# A cell may be moved together with what lies this near; what is farther is absolute.
NEAR_LEVELS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSource:
    """What a starter cell is made from.

    Attributes
    ----------
    label : str
        Name of the URDF file.
    urdf, srdf, joint_limits : str
        References as the cell will have them; "" where there is none.
    robot : UrdfDescription
    moveit : SrdfDescription or None
    packages : mapping
        Packages that the cell must name, to folders as it will have them.
    xacro_args : mapping
    bodies : tuple of SceneBody
        Of planning scenes.
    notes : tuple of str
        What was left out.
    """

    label: str
    urdf: str
    robot: UrdfDescription
    packages: Mapping[str, str]
    xacro_args: Mapping[str, str]
    srdf: str = ""
    joint_limits: str = ""
    moveit: SrdfDescription | None = None
    bodies: tuple[SceneBody, ...] = ()
    notes: tuple[str, ...] = ()


def read_source(
    urdf: str,
    folder: Path,
    *,
    packages: Mapping[str, str],
    xacro_args: Mapping[str, str],
    moveit_config: Path | None,
) -> RobotSource:
    """Read the URDF and what belongs to it.

    Parameters
    ----------
    urdf : str
        Path, or ``package://NAME/PATH``.
    folder : Path
        Where the cell will be.
    packages, xacro_args : mapping
        As given on the command line; folders relative to the current one.
    moveit_config : Path, optional
        Folder of a MoveIt configuration.

    Raises
    ------
    CellError, SettingsError
        Something cannot be found or read, or an argument is unknown.
    """
    for name, given in packages.items():
        if not is_folder(Path(given)):
            raise SettingsError(f"--package {name}={given}: no such folder")
    given_folders = {name: str(Path(f).absolute()) for name, f in packages.items()}
    resolver = Resolver(directory=folder, packages=given_folders)
    reference = urdf if "://" in urdf else _shown(Path(urdf).absolute(), folder)
    try:
        path, _ = resolver.resolve_robot(reference)
    except NotFoundError as error:
        raise SettingsError(str(error)) from None
    resolver = replace(resolver, urdf_folder=path.parent)
    expansion = robot_text(path, xacro_args, resolver)
    robot = parse_urdf(expansion.text, path.name)
    found = RobotSource(
        label=path.name,
        urdf=reference,
        robot=robot,
        packages={},
        xacro_args=dict(xacro_args),
    )
    expansions = [expansion]
    if moveit_config is not None:
        found = _with_moveit(found, moveit_config, resolver, expansions)
    _check_arguments(xacro_args, expansions)
    named = [*given_folders, *_packages_of(found, expansions)]
    places = {name: _to_be_named(resolver, name) for name in dict.fromkeys(named)}
    shown = {name: _shown(place, folder) for name, place in places.items() if place}
    return replace(found, packages=shown)


def _shown(path: Path, folder: Path) -> str:
    """Write a path: relative if it lies in the cell's folder or near it."""
    relative = Path(os.path.relpath(path, folder))
    ups = relative.parts.count("..")
    shared = Path(os.path.commonpath([path, folder]))
    near = ups <= NEAR_LEVELS and shared != Path(shared.anchor)
    return relative.as_posix() if near else str(path)


def _with_moveit(
    found: RobotSource,
    moveit_config: Path,
    resolver: Resolver,
    expansions: list[Expansion],
) -> RobotSource:
    config = find_moveit_config(moveit_config, found.robot.name)
    folder = resolver.directory
    if config.srdf is not None:
        path = config.srdf.absolute()
        expansions.append(robot_text(path, found.xacro_args, resolver))
        srdf = parse_srdf(expansions[-1].text, path.name, found.robot)
        found = replace(found, srdf=_shown(path, folder), moveit=srdf)
    if config.joint_limits is not None:
        limits = _shown(config.joint_limits.absolute(), folder)
        found = replace(found, joint_limits=limits)
    bodies: list[SceneBody] = []
    notes = [*found.notes]
    for path in config.scenes:
        some, left_out = read_scene(path)
        taken = {body.name for body in bodies}
        bodies += [body for body in some if body.name not in taken]
        notes += left_out
        notes += [
            f"{path.name}: {body.name!r} is in another scene, too, and left out here"
            for body in some
            if body.name in taken
        ]
    return replace(found, bodies=tuple(bodies), notes=tuple(notes))


def _check_arguments(given: Mapping[str, str], expansions: list[Expansion]) -> None:
    known = [name for e in expansions for name in e.arguments]
    problems = [
        f"--xacro-arg {name}: no such argument; "
        + (did_you_mean(name, known) or "the URDF takes none")
        for name in given
        if name not in known
    ]
    if problems:
        raise SettingsError(problems)


def _packages_of(found: RobotSource, expansions: list[Expansion]) -> list[str]:
    """Names of the packages that a robot refers to."""
    references = [
        found.urdf,
        *mesh_scales(found.robot.collisions),
        *found.robot.visual_meshes,
    ]
    names = [
        text.removeprefix(SCHEME).lstrip("/").split("/")[0]
        for text in references
        if text.startswith(SCHEME)
    ]
    return [*names, *(name for e in expansions for name in e.packages)]


def _to_be_named(resolver: Resolver, name: str) -> Path | None:
    """Folder of a package found by the environment only, to be named in the cell."""
    if name in resolver.packages:
        return Path(resolver.packages[name])
    return resolver.found_by_environment(name)
