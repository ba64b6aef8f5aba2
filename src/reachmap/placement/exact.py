"""The exact score of a bin pose: roadmap to a coarse grid, bin in the scene."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.scene import Scene
from reachmap.geometry import yaw_transform
from reachmap.maps.records import Status
from reachmap.placement.footprint import coarse_spec
from reachmap.sampling.frames import bin_test_frames
from reachmap.scans.survey import Survey, survey_frames
from reachmap.scans.workspace_roadmap import connect_survey, results_of_connection

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

ATTEMPTS = 2
Pose = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseScore:
    """How well the arm is served at one pose of the bin.

    Attributes
    ----------
    score : float
        Mean path reachability over the pick volume [percent].
    worst_point : float
        Path reachability of the worst point [percent].
    reachable_share : float
        Share of test frames with an IK solution [percent], which no path can exceed.
    path_length_rad : float
        Mean over the frames with a path; infinite without any, NaN where the map was
        interpolated.
    """

    score: float
    worst_point: float
    reachable_share: float
    path_length_rad: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedScene:
    """A cell with its bin at one pose, and the goals of the coarse test frames.

    Attributes
    ----------
    scene : Scene
    survey : Survey
    orientations : int
        Test frames at each point.
    """

    scene: Scene
    survey: Survey
    orientations: int

    @classmethod
    def build(cls, loaded: LoadedCell, pose: Pose) -> PlacedScene:
        """Put the bin at a pose (x, y, z [m], yaw [rad]) and survey the frames."""
        changed = loaded.with_changes(bin_pose=yaw_transform(*pose))
        scene = Scene.build(changed, with_bin=True)
        cell = changed.cell
        spec = coarse_spec(cell.bin_scan, cell.bin.inner)
        axis = cell.robot.tcp.approach_axis
        grid = bin_test_frames(spec, cell.bin, axis, scene.T_base_bin).frames
        scene.checker.reset()
        survey = survey_frames(
            scene, grid.transforms_at(slice(None)), spec.approach_distance_m
        )
        return cls(scene=scene, survey=survey, orientations=grid.shape[-1])

    @property
    def bound(self) -> float:
        """Share of frames with a goal [percent]: no score can be higher."""
        return 100.0 * float((self.survey.status == Status.NOT_ATTEMPTED).mean())

    def score_from(self, q: FloatArray) -> PoseScore:
        """Score the pose from a scan configuration (dof,), which must be free."""
        scene = dataclasses.replace(self.scene, scan_configuration=q)
        seed = scene.loaded.cell.seed
        connection = connect_survey(scene, self.survey, attempts=ATTEMPTS, seed=seed)
        results = results_of_connection(self.survey, connection)
        found = results.status == Status.PATH_FOUND
        points = 100.0 * found.reshape(-1, self.orientations).mean(axis=1)
        lengths = results.path_length[found]
        return PoseScore(
            score=float(points.mean()),
            worst_point=float(points.min()),
            reachable_share=100.0 * float((results.n_ik > 0).mean()),
            path_length_rad=float(lengths.mean()) if found.any() else np.inf,
        )
