"""The picture of a new placement."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from reachmap._typing import FloatArray
from reachmap.core.collision.camera import Camera
from reachmap.geometry import inverse_transform
from reachmap.placement.mapped.viewpoints import picture_corners
from reachmap.runtime.options import RunOptions

if TYPE_CHECKING:
    from reachmap.tools.place_bin import PlacedBin


def draw_placed(path: Path, placed: PlacedBin, run: RunOptions) -> None:
    """Draw a placement to a .png or .svg file."""
    from reachmap.plots.parts.files import write_picture
    from reachmap.plots.placement import draw_placement

    placement = placed.placement
    figure = draw_placement(
        placement, placed.workspace, camera_view=_camera_view(placed)
    )
    write_picture(
        path,
        figure,
        title="Where the bin goes",
        config_sha256=placement.stamp.config_sha256,
        overwrite=run.overwrite,
    )


def _camera_view(placed: PlacedBin) -> FloatArray | None:
    """What the camera sees at the height of the rim, shape (4, 2) [m]."""
    placement, problem = placed.placement, placed.problem
    cell, scene = problem.loaded.cell, problem.scene
    if cell.camera is None:
        return None
    camera = Camera(scene.robot, problem.loaded)
    T_base_camera = camera.T_base_camera(placement.scan_configuration)
    T_level_camera = inverse_transform(placement.T_base_level) @ T_base_camera
    rim = float(placement.candidate_pose[placement.chosen, 2]) + cell.bin.inner[2]
    return picture_corners(T_level_camera, cell.camera, rim)
