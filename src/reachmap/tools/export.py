"""``reachmap export``: a bin map in, verified motions out."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from reachmap.core.planning.time_laws.law import BLENDING_LAWS
from reachmap.core.robot.model import RobotModel
from reachmap.core.scene import Scene
from reachmap.disk import as_path, one_or_more
from reachmap.errors import SettingsError
from reachmap.maps import read_bin_map
from reachmap.maps.bytes.publish import check_outputs, publish
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.records import BinMap
from reachmap.motions.formats import WRITERS, Origin
from reachmap.motions.motion import Motion, best_rows, motion_of, row_of

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


@dataclass(frozen=True, slots=True, kw_only=True)
class Exported:
    """Motions as text."""

    motions: tuple[Motion, ...]
    text: str
    written: Path | None = None


def export(
    map_path: str | Path,
    *,
    grasps: Sequence[str] = (),
    every: bool = False,
    to: str = "csv",
    output: str | Path | None = None,
    overwrite: bool = False,
) -> Exported:
    """Write the best stored paths of a bin map for a controller or a program.

    Parameters
    ----------
    map_path : Path
    grasps : sequence of str
        Test grasps as ``y,x,orientation`` or ``layer,y,x,orientation``.
    every : bool
        All test grasps that have a path.
    to : str
        One of :data:`reachmap.motions.formats.WRITERS`.
    output : Path, optional
        File to write.
    overwrite : bool

    Raises
    ------
    SettingsError
        Nothing or too much was named, or the format cannot say it.
    MapFileError, OutputError
    """
    map_path = Path(map_path)
    grasps, output = one_or_more(grasps), as_path(output)
    if every == bool(grasps):
        raise SettingsError("name test grasps with --grasp, or take --all of them")
    if to not in WRITERS:
        raise SettingsError(f"--to {to}: expected one of {', '.join(WRITERS)}")
    check_outputs([output], overwrite=overwrite, inputs=[map_path])
    bin_map = read_bin_map(map_path)
    rows = (
        list(best_rows(bin_map).values())
        if every
        else [row_of(bin_map, name) for name in dict.fromkeys(grasps)]
    )
    if not rows:
        raise SettingsError(f"{map_path}: no test grasp has a path")
    origin = _origin(bin_map, map_path)
    motions = tuple(
        motion_of(bin_map, row, origin.velocity, origin.acceleration) for row in rows
    )
    if to == "json":
        motions = _with_blends(
            motions, cell_of_artefact(bin_map.provenance, str(map_path))
        )
    text = WRITERS[to](motions, origin)
    if output is not None:
        publish(output, [text.encode()], overwrite=overwrite)
    return Exported(motions=motions, text=text, written=output)


def _with_blends(motions: Sequence[Motion], loaded: LoadedCell) -> tuple[Motion, ...]:
    """Motions with the blends of their corners, where the cell's time law has any."""
    if loaded.cell.planner.time_law not in BLENDING_LAWS:
        return tuple(motions)
    fillings = loaded.fillings()
    found = []
    for motion in motions:
        layer = motion.test_grasp[0] if len(fillings) > 1 else 0
        scene = Scene.shared(fillings[layer], with_bin=True)
        corners = motion.configuration[: motion.pre_grasp + 1]
        blends = scene.time_law.blends(corners)
        blend_rad = np.zeros(len(motion.configuration))
        blend_rad[: len(blends.blend)] = blends.blend
        found.append(dataclasses.replace(motion, blend_rad=blend_rad))
    return tuple(found)


def _origin(bin_map: BinMap, map_path: Path) -> Origin:
    loaded = cell_of_artefact(bin_map.provenance, str(map_path))
    robot = RobotModel.from_cell(loaded)
    tcp = loaded.cell.robot.tcp
    numbers = ", ".join(f"{value:g}" for value in tcp.matrix().ravel())
    return Origin(
        map_sha256=bin_map.stamp.content_sha256,
        cell_sha256=bin_map.stamp.cell_sha256,
        cell=loaded.cell.name,
        base=loaded.cell.robot.base_frame or "robot_base",
        tcp=f"in {tcp.parent}, 4x4 by rows [{numbers}]",
        joint_names=bin_map.joint_names,
        is_revolute=robot.is_revolute,
        velocity=robot.velocity_rad_s,
        acceleration=robot.acceleration_rad_s2,
    )
