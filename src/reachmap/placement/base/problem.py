"""The problem of placing a robot base, and checks of single poses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import BoolArray, FloatArray
from reachmap.errors import CellError
from reachmap.placement.base.fit import BaseFit
from reachmap.placement.base.mounting import AnyMounting
from reachmap.placement.mapped.candidates import Candidate, mapped_candidates
from reachmap.placement.mapped.evaluator import Evaluator
from reachmap.placement.mapped.exact import ALWAYS, NEVER, PlacedScene, Pose, PoseScore
from reachmap.placement.mapped.imaging import imaging_configurations
from reachmap.placement.mapped.sample import THIN, Grid, sample_of
from reachmap.placement.predicted.region import Region
from reachmap.scans.cycle.places import drop_off_poses

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell
    from reachmap.core.scene import Scene

# Two bases this far apart stand in different places [m].
DIFFERENT_PLACE_M = 0.2
# Frames of a prediction: few, for hundreds of places are looked at.
SPARSE: Grid = (3, 3, 3)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BaseProblem:
    """An arm, its mounting, and where its base may stand.

    Attributes
    ----------
    loaded : LoadedCell
        Its world is the level frame, see :func:`reachmap.cell.base_pose.level_frame`.
    mounting : Mounting or RailMounting
    is_open : bool array, shape (layers, y, x, orientations)
        See :func:`reachmap.placement.mapped.sample.open_frames`.
    region : Region
    own : pose
        Where the cell has the base.
    scene : Scene
        Of the mounting; what uses it moves its world.
    scan_configuration : array, shape (dof,)
        The cell's own [rad].
    keep_scan : bool
    fit : BaseFit or None
        None where nothing but the arm moves.
    evaluator : Evaluator
    """

    loaded: LoadedCell
    mounting: AnyMounting
    is_open: BoolArray
    region: Region
    own: Pose
    scene: Scene
    scan_configuration: FloatArray
    keep_scan: bool
    fit: BaseFit | None
    evaluator: Evaluator

    def reason_against(self, pose: Pose) -> str:
        """Why the base cannot stand at a pose, or ""."""
        outside = self.region.outside(np.array(pose))
        return f"outside the region in {outside}" if outside else self.contact(pose)

    def contact(self, pose: Pose) -> str:
        """What the base would collide with, or that no drop-off is in reach, or ""."""
        met = "" if self.fit is None else self.fit.reason_against(pose)
        return met or self._without_drop_off(pose)

    def _without_drop_off(self, pose: Pose) -> str:
        """Say that no drop-off has a configuration that is free of collision, or "".

        One is enough. Those given by joint values go with the arm.
        """
        specs = self.loaded.cell.drop_offs
        if not specs or any(spec.pose is None for spec in specs):
            return ""
        scene = self.scene_at(pose)
        for spec in specs:
            T = drop_off_poses(scene.loaded.cell, spec)
            Q, _ = scene.kinematics.solve_many(T, windings=False)
            if any(scene.checker.is_free(q) for q in Q):
                return ""
        return "no drop-off can be reached"

    def can_be_imaged(self, pose: Pose) -> bool:
        """Whether some scan configuration images the bin, where it may be chosen."""
        if self.keep_scan:
            return True
        return next(imaging_configurations(self.scene_at(pose)), None) is not None

    def is_possible(self, pose: Pose, q: FloatArray) -> bool:
        """Whether the arm can be at a configuration with its base at a pose."""
        # A rail ends where it ends; elsewhere the region is only where to look.
        if self.fit is None and self.region.outside(np.array(pose)):
            return False
        if self.contact(pose):
            return False
        try:
            return self.scene_at(pose).checker.is_free(q)
        except CellError:
            return False

    def scene_at(self, pose: Pose) -> Scene:
        """The scene with the base at a pose."""
        return self.mounting.at(self.scene, self.mounting.cell_at(self.loaded, pose))

    def placed(self, pose: Pose) -> PlacedScene:
        """The scene with the base at a pose, and the goals of its test frames."""
        sample = sample_of(self.loaded.cell, THIN, self.is_open)
        return PlacedScene(self.scene, pose, sample, self.mounting)

    @property
    def start(self) -> FloatArray | None:
        """Scan configuration that poses are mapped from, None if it is chosen later."""
        return self.scan_configuration if self.keep_scan else None

    def bounds(self, poses: Sequence[Pose]) -> list[Candidate]:
        """What no score can exceed, by inverse kinematics and collision alone."""
        found = self.evaluator.evaluate(poses, None, above=NEVER, grid=SPARSE)
        return [
            Candidate(
                pose=pose,
                score=PoseScore(
                    score=e.bound,
                    worst_point=0.0,
                    reachable_share=e.reachable_share,
                    path_length_rad=np.nan,
                ),
            )
            for pose, e in zip(poses, found, strict=True)
        ]

    def exact(
        self, poses: Sequence[Pose], *, above: float | Sequence[float] = ALWAYS
    ) -> list[Candidate]:
        """Map poses; those whose bound is not above a score are left out."""
        found = self.evaluator.evaluate(poses, self.start, above=above)
        return mapped_candidates(poses, found)
