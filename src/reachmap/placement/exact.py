"""The exact score of a bin pose: roadmap to a coarse grid, bin in the scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from reachmap.cell.model import BinScanSpec
from reachmap.core.scene import Scene
from reachmap.maps.records import Status
from reachmap.sampling.frames import bin_test_frames
from reachmap.scans.survey import survey_frames
from reachmap.scans.workspace_roadmap import connect_survey, results_of_connection

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

COARSE_GRID = (5, 4)
MAX_LAYERS = 3
ATTEMPTS = 2


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
        Mean over the frames with a path, infinite without any.
    """

    score: float
    worst_point: float
    reachable_share: float
    path_length_rad: float


def coarse_spec(spec: BinScanSpec, inner: tuple[float, float, float]) -> BinScanSpec:
    """Bin scan with few points: the cell's orientations, layers and approach.

    The longer side gets the larger count; of many layers the lowest, the middle and
    the highest are kept.
    """
    wanted = COARSE_GRID if inner[0] >= inner[1] else COARSE_GRID[::-1]
    layers = spec.layers
    if len(layers) > MAX_LAYERS:
        layers = (layers[0], layers[len(layers) // 2], layers[-1])
    grid = (min(wanted[0], spec.grid[0]), min(wanted[1], spec.grid[1]))
    return spec.model_copy(update={"grid": grid, "layers": layers})


def score_scene(scene: Scene) -> PoseScore:
    """Score the bin of a scene, seen from its scan configuration."""
    cell = scene.loaded.cell
    spec = coarse_spec(cell.bin_scan, cell.bin.inner)
    axis = cell.robot.tcp.approach_axis
    grid = bin_test_frames(spec, cell.bin, axis, scene.T_base_bin).frames
    scene.checker.reset()
    survey = survey_frames(
        scene, grid.transforms_at(slice(None)), spec.approach_distance_m
    )
    connection = connect_survey(scene, survey, attempts=ATTEMPTS, seed=cell.seed)
    results = results_of_connection(survey, connection)
    found = results.status == Status.PATH_FOUND
    points = 100.0 * found.reshape(-1, grid.shape[-1]).mean(axis=1)
    lengths = results.path_length[found]
    return PoseScore(
        score=float(points.mean()),
        worst_point=float(points.min()),
        reachable_share=100.0 * float((results.n_ik > 0).mean()),
        path_length_rad=float(lengths.mean()) if found.any() else float("inf"),
    )


def score_cell(loaded: LoadedCell) -> PoseScore:
    """Score a cell's bin where the cell has it."""
    return score_scene(Scene.build(loaded, with_bin=True))
