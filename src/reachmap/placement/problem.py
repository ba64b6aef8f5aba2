"""The problem of placing a bin, and checks of single poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.cell.bins.support import (
    SLACK_M,
    TopFace,
    footprint_of_bin,
    support_of,
)
from reachmap.core.collision.bin_fit import BinFit
from reachmap.core.scene import Scene
from reachmap.geometry import yaw_transform
from reachmap.maps.records import WorkspaceMap
from reachmap.placement.mapped.candidates import Candidate, mapped_candidates
from reachmap.placement.mapped.evaluator import Evaluator
from reachmap.placement.mapped.exact import ALWAYS, Pose
from reachmap.placement.mapped.imaging import (
    OUT_OF_SIGHT,
    imaging_configurations,
    is_in_picture,
    picture_of,
    why_unseen,
)
from reachmap.placement.predicted.places import (
    best_at_each_place,
    pose_grid,
    single_pose,
)
from reachmap.placement.predicted.prediction import field_of, footprint_of, predict
from reachmap.placement.predicted.region import Region
from reachmap.placement.room import DropOffRoom, PickRoom
from reachmap.placement.supports import natural_poses
from reachmap.placement.tolerance import EXACT, Tolerance

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacementProblem:
    """A cell, its workspace map, and where the bin may stand.

    Attributes
    ----------
    loaded : LoadedCell
    workspace : WorkspaceMap
        With levels that rise, see :mod:`reachmap.maps.summary.upright`.
    is_open : bool array, shape (layers, y, x, orientations)
        See :func:`reachmap.placement.mapped.sample.open_frames`.
    region : Region
    scene : Scene
        Without the bin.
    moving : Scene
        With a bin that can be moved, to look at one pose after the other.
    still_camera : array, shape (4, 4), or None
        T_base_camera of a camera that is not on the tool: where the bin must be in its
        picture.
    tolerance : Tolerance
        How far the bin may be off.
    faces : tuple of TopFace
        What there is to stand on, in the level frame.
    supports : tuple of TopFace
        Those that the bin must stand on one of; it may float where there is none.
    keep_scan : bool
        Whether the cell's own scan configuration stays.
    fit : BinFit
        With the arm at the scan configuration if that stays, else without the arm.
    drop_offs : DropOffRoom or None
        What a bin may not stand in; None where parts are put down nowhere.
    picks : PickRoom or None
        Where other bins are picked from; None where there are none.
    evaluator : Evaluator
    """

    loaded: LoadedCell
    workspace: WorkspaceMap
    is_open: BoolArray
    region: Region
    scene: Scene
    moving: Scene
    keep_scan: bool
    fit: BinFit
    evaluator: Evaluator
    drop_offs: DropOffRoom | None = None
    picks: PickRoom | None = None
    still_camera: FloatArray | None = None
    tolerance: Tolerance = EXACT
    faces: tuple[TopFace, ...] = ()
    supports: tuple[TopFace, ...] = ()

    @property
    def different_place_m(self) -> float:
        """Distance of centres from which two bins stand in different places."""
        return max(self.loaded.cell.bin.inner[:2]) / 2

    def T_base_bin(self, pose: Pose) -> FloatArray:  # noqa: N802
        """The bin at a pose, in robot_base, shape (4, 4)."""
        return np.asarray(self._T_base_level @ yaw_transform(*pose))

    @cached_property
    def _T_base_level(self) -> FloatArray:  # noqa: N802
        return self.loaded.cell.T_base_level()

    def reason_against(self, pose: Pose, *, floats: bool = False) -> str:
        """Why the bin cannot stand at a pose, or ""; it may float if that is said."""
        outside = self.region.outside(np.array(pose))
        if outside:
            return f"outside the region in {outside}"
        if self.supports and not floats:
            overhang = self._overhang(pose)
            if overhang:
                return overhang
        obstruction = self.obstruction(pose)
        if obstruction:
            return obstruction
        if self.still_camera is None:
            return ""
        seen = is_in_picture(self.loaded.cell, self.still_camera, self.T_base_bin(pose))
        return "" if seen else OUT_OF_SIGHT

    def obstruction(self, pose: Pose, fit: BinFit | None = None) -> str:
        """What the bin would collide with, or leave no room for, at a pose; or "".

        Parameters
        ----------
        pose : (x, y, z [m], yaw [rad])
        fit : BinFit, optional
            With the arm somewhere else than :attr:`fit` has it.
        """
        contact = (fit or self.fit).contact(self.T_base_bin(pose))
        return self.without_room(pose) if contact is None else contact.reason

    def without_room(self, pose: Pose) -> str:
        """Say which drop-off, or which other bin, the bin leaves no room, or ""."""
        T_base_bin = self.T_base_bin(pose)
        taken = self.drop_offs.taken(T_base_bin) if self.drop_offs else ""
        if taken:
            return f"the bin leaves no room at the drop-off {taken}"
        taken = self.picks.taken(T_base_bin) if self.picks else ""
        return f"the bin leaves no room for grasps in bin {taken}" if taken else ""

    def support(self, pose: Pose) -> str:
        """Name of the body that the bin stands on at a pose, "" where it floats."""
        bin_spec = self.loaded.cell.bin
        return support_of(bin_spec, yaw_transform(*pose), self.faces)

    def _overhang(self, pose: Pose) -> str:
        """Why the bin does not stand on a support at a pose, or ""."""
        bin_spec = self.loaded.cell.bin
        z = pose[2] - bin_spec.bottom_m
        under = [face for face in self.supports if abs(face.z - z) < 1e-6]
        if not under:
            return "the bin stands on nothing"
        corners = footprint_of_bin(bin_spec, yaw_transform(*pose))
        if min(face.overhang_m(corners) for face in under) <= SLACK_M:
            return ""
        names = " or ".join(face.name for face in under)
        return f"the bin hangs over the edge of {names}"

    def can_be_imaged(self, pose: Pose) -> bool:
        """Whether some scan configuration, or the one that stays, images the bin.

        Where the configuration is kept, a camera on the tool is not checked.
        """
        if self.keep_scan and self.still_camera is None:
            return True
        scene = self._scene_at(pose)
        if self.keep_scan:
            return not picture_of(scene, scene.scan_configuration)
        return next(imaging_configurations(scene), None) is not None

    def why_unseen(self, pose: Pose) -> str:
        """What keeps the bin at a pose from being imaged, or "" if that is unknown."""
        scene = self._scene_at(pose)
        if self.still_camera is not None:
            return picture_of(scene, scene.scan_configuration)
        return why_unseen(scene)

    def _scene_at(self, pose: Pose) -> Scene:
        changed = self.loaded.with_changes(bin_pose=self.T_base_bin(pose))
        return self.moving.with_bin_of(changed)

    @property
    def start(self) -> FloatArray | None:
        """Scan configuration that poses are mapped from, None if it is chosen later."""
        return self.scene.scan_configuration if self.keep_scan else None

    def exact(
        self, poses: Sequence[Pose], *, above: float | Sequence[float] = ALWAYS
    ) -> list[Candidate]:
        """Map poses with the bin in the scene.

        Poses whose bound is not above a score are left out; those without a scan
        configuration come with the reason.
        """
        found = self.evaluator.evaluate(poses, self.start, above=above)
        return mapped_candidates(poses, found)

    def predicted(self) -> list[Candidate]:
        """Best pose at each place, and natural ones, by interpolation of the map."""
        workspace, cell = self.workspace, self.loaded.cell
        heights = [face.z + cell.bin.bottom_m for face in self.supports]
        grid = pose_grid(
            self.region, workspace.x, workspace.y, workspace.z, heights=heights
        )
        natural = natural_poses(cell, self.region, self.supports)
        field, footprint = field_of(workspace), footprint_of(cell, self.is_open)
        found = {
            place.pose: place
            for poses in (grid, *map(single_pose, natural))
            for place in best_at_each_place(
                predict(field, footprint, poses), self.reason_against
            )
        }
        return list(found.values())
