"""The files of a MoveIt configuration package that a cell can use."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from reachmap.cell.files.srdf import SrdfDescription
from reachmap.cell.files.urdf import UrdfDescription
from reachmap.disk import is_file, is_folder
from reachmap.errors import SettingsError

SCENE_SUFFIXES = (".scene", ".yaml", ".yml")


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveItConfig:
    """Files of a MoveIt configuration.

    Attributes
    ----------
    srdf, joint_limits : Path or None
    scenes : tuple of Path
        Files that may hold bodies of a planning scene.
    """

    srdf: Path | None
    joint_limits: Path | None
    scenes: tuple[Path, ...]


def find_moveit_config(folder: Path, robot: str) -> MoveItConfig:
    """Look for the files in ``DIR/config``, ``DIR/srdf`` and ``DIR``.

    Parameters
    ----------
    folder : Path
    robot : str
        Name of the URDF, which chooses among several SRDFs.

    Raises
    ------
    SettingsError
        There is no such folder, nothing to use in it, or more than one SRDF.
    """
    if not is_folder(folder):
        raise SettingsError(f"--moveit-config {folder}: no such folder")
    named = (folder / "config", folder / "srdf", folder)
    places = [place for place in named if is_folder(place)]
    srdf = _the_srdf(folder, places, robot)
    limits = [p / "joint_limits.yaml" for p in places]
    found = next((path for path in limits if is_file(path)), None)
    scenes = tuple(
        path
        for path in sorted(folder.rglob("*"), key=lambda p: (p.suffix != ".scene", p))
        if path.suffix in SCENE_SUFFIXES and is_file(path)
    )
    if srdf is None and found is None:
        raise SettingsError(
            f"--moveit-config {folder}: neither an SRDF nor joint_limits.yaml in it or "
            "in its folders config and srdf"
        )
    return MoveItConfig(srdf=srdf, joint_limits=found, scenes=scenes)


def _the_srdf(folder: Path, places: Sequence[Path], robot: str) -> Path | None:
    """The SRDF: a plain one before a xacro, the robot's own among several."""
    for pattern in ("*.srdf", "*.srdf.xacro"):
        files = [path for place in places for path in place.glob(pattern)]
        # Files of macros, which makers keep beside, are no SRDF by themselves.
        found = sorted(path for path in files if "macro" not in path.name)
        own = [path for path in found if path.name.split(".")[0] == robot]
        if len(own or found) == 1:
            return (own or found)[0]
        if found:
            names = ", ".join(path.name for path in found)
            raise SettingsError(
                f"--moveit-config {folder}: several SRDFs ({names}) and none is called "
                f"{robot}; use a copy of the folder without the others"
            )
    return None


def planning_group(
    robot: UrdfDescription, srdf: SrdfDescription, fingers: Collection[str]
) -> tuple[str, ...]:
    """Joints of the SRDF's group that is the arm: its longest single chain.

    Groups with fingers are those of the arm together with its hand.
    """
    chains = [tuple(robot.chain(robot.root, link)) for link in robot.links]
    best: tuple[str, ...] = ()
    for joints in srdf.groups.values():
        if not set(fingers).isdisjoint(joints):
            continue
        ordered = next(
            (
                tuple(name for name in chain if name in joints)
                for chain in chains
                if set(joints) <= set(chain)
            ),
            (),
        )
        if len(ordered) > len(best):
            best = ordered
    return best
