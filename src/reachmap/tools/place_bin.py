"""``place-bin``: from a workspace map to the pose of the bin."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import BoolArray
from reachmap.cell.bins.support import TopFace, top_faces
from reachmap.cell.model.robot import LISTED
from reachmap.core.collision.bin_fit import BinFit
from reachmap.core.scene import Scene
from reachmap.disk import as_path
from reachmap.errors import SceneError, SettingsError
from reachmap.geometry import inverse_transform
from reachmap.maps import (
    BinPlacement,
    RunClock,
    WorkspaceMap,
    check_outputs,
    read_workspace_map,
    write_placement,
)
from reachmap.maps.bytes.publish import check_picture
from reachmap.maps.provenance import cell_of_artefact
from reachmap.maps.records import Stamp
from reachmap.maps.summary.upright import upright_workspace
from reachmap.placement.decision import (
    Decision,
    Outcome,
    decide_as_given,
    decide_by_paper,
    settle,
    why_no_place,
)
from reachmap.placement.mapped.evaluator import Evaluator, open_evaluator
from reachmap.placement.mapped.exact import Pose
from reachmap.placement.mapped.imaging import can_choose, still_camera
from reachmap.placement.mapped.sample import open_frames
from reachmap.placement.predicted.region import AXES, Region, region_of
from reachmap.placement.problem import PlacementProblem
from reachmap.placement.room import DropOffRoom, PickRoom
from reachmap.placement.search import decide_by_search
from reachmap.placement.settings import placement_settings
from reachmap.placement.summary import best_rows, placement_facts, row_facts
from reachmap.placement.supports import supports_in
from reachmap.placement.tolerance import Tolerance
from reachmap.placement.tool_limit import ToolLimit, tool_limit
from reachmap.runtime.options import IN_PROCESS, RunOptions
from reachmap.runtime.progress import Progress
from reachmap.scans.document import (
    checking_settings,
    provenance_from_document,
    scan_document,
)
from reachmap.tools.placement_picture import draw_placed
from reachmap.tools.prologue import (
    check_places,
    refuse_cell_files,
    warn_of_moving,
    with_seed,
)

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

logger = logging.getLogger(__name__)

__all__ = [
    "PlacementChoice",
    "best_rows",
    "place_bin",
    "placement_facts",
    "row_facts",
]

# What is scored, with rolls as they are listed and where they do not matter.
FIGURES = ("frames", "directions")
RULES = ("search", "paper")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacementChoice:
    """Options on how the bin is placed.

    Attributes
    ----------
    rule : {"search", "paper"}
    bin_pose : tuple of float, optional
        x, y, z [m], yaw [deg]: scored instead of searching.
    limits : mapping
        ``x``, ``y``, ``z`` to (low, high) [m], inside the cell's own limits.
    fixed : mapping
        ``x``, ``y``, ``z`` [m] or ``yaw`` [deg] to a value.
    top : int
        Different places that are mapped with the bin in the scene.
    tolerance : pair of float, optional
        Shift [m] and turn [deg] to take the worst case over, instead of the cell's.
    keep_scan_configuration : bool
        Leave the cell's own, as is also done without a camera, or with one on a link
        between base and tool.

    Raises
    ------
    SettingsError
        A range runs backwards or ends nowhere, an axis or rule is unknown, or no place
        is left.
    """

    rule: str = "search"
    bin_pose: tuple[float, float, float, float] | None = None
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    top: int = 5
    tolerance: tuple[float, float] | None = None
    keep_scan_configuration: bool = False

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise SettingsError(f"rule {self.rule!r}: expected {' or '.join(RULES)}")
        check_places(self.limits, self.fixed, axes=AXES, top=self.top)


def place_bin(
    workspace: str | Path,
    output: str | Path,
    *,
    choice: PlacementChoice | None = None,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    picture: str | Path | None = None,
    run: RunOptions = IN_PROCESS,
) -> BinPlacement:
    """Choose where the bin stands, and the configuration it is imaged from.

    Parameters
    ----------
    workspace : Path
        Artefact of workspace-scan, which holds the cell.
    output : Path
        The artefact to write.
    choice : PlacementChoice, optional
    overrides : sequence of str
        ``key.path=value``.
    seed : int, optional
    picture : Path, optional
        Also draw the placement there; the suffix, .png or .svg, says how.
    run : RunOptions

    Returns
    -------
    BinPlacement
        What was written.

    Raises
    ------
    ReachmapError
        See :mod:`reachmap.errors`.
    """
    workspace, output = Path(workspace), Path(output)
    picture = as_path(picture)
    choice = choice or PlacementChoice()
    check_picture(picture, "--picture")
    check_outputs([output, picture], overwrite=run.overwrite, inputs=[workspace])
    workspace_map = read_workspace_map(workspace)
    loaded = cell_of_artefact(
        workspace_map.provenance, str(workspace), with_seed(overrides, seed)
    )
    refuse_cell_files([output, picture], loaded)
    warn_of_moving(loaded)
    placed = placed_bin(loaded, workspace_map, choice, run)
    write_placement(output, placed.placement, overwrite=run.overwrite)
    if picture is not None:
        draw_placed(picture, placed, run)
    return placed.placement


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedBin:
    """A placement with what it was decided on.

    Attributes
    ----------
    placement : BinPlacement
    workspace : WorkspaceMap
        Upright.
    problem : PlacementProblem
    """

    placement: BinPlacement
    workspace: WorkspaceMap
    problem: PlacementProblem


def placed_bin(
    loaded: LoadedCell,
    workspace_map: WorkspaceMap,
    choice: PlacementChoice,
    run: RunOptions,
) -> PlacedBin:
    """Choose a place; nothing is written.

    Parameters
    ----------
    loaded : LoadedCell
        Other bins of it stand where it has them.
    workspace_map : WorkspaceMap
    choice : PlacementChoice
    run : RunOptions

    Raises
    ------
    SceneError
        The bin can stand nowhere, or cannot be imaged.
    """
    clock = RunClock(workers=run.workers)
    workspace_map = upright_workspace(workspace_map, loaded.cell.T_base_level())
    region = _region(loaded, workspace_map, choice)
    scene = Scene.shared(loaded, with_bin=False)
    scene.require_free_scan_configuration()
    is_open = open_frames(scene.robot, loaded)
    with open_evaluator(
        loaded,
        is_open,
        run,
        progress=Progress("place-bin", quiet=run.quiet),
    ) as evaluator:
        problem = _problem(
            loaded, workspace_map, scene, is_open, region, choice, evaluator
        )
        with clock.phase("decide"):
            decision = _decide(problem, choice)
            why = why_no_place(problem, decision)
            if why and choice.bin_pose is None and choice.rule == "search":
                raise SceneError(why)
            if why:
                logger.warning("%s", why)
        with clock.phase("settle"):
            outcome = settle(problem, decision)
        clock.add_cpu("workers", evaluator.cpu_s if run.workers > 1 else 0.0)
    placement = _record(problem, decision, outcome, choice, clock)
    return PlacedBin(placement=placement, workspace=workspace_map, problem=problem)


def _problem(
    loaded: LoadedCell,
    workspace: WorkspaceMap,
    scene: Scene,
    is_open: BoolArray,
    region: Region,
    choice: PlacementChoice,
    evaluator: Evaluator,
) -> PlacementProblem:
    cell = loaded.cell
    keep_scan = choice.keep_scan_configuration or not can_choose(scene)
    fit = BinFit(scene.robot, loaded, scene.scan_configuration if keep_scan else None)
    T_level_world = inverse_transform(cell.T_base_level()) @ cell.T_base_world()
    faces = top_faces(cell, T_level_world)
    supports = supports_in(cell, region, faces, fit)
    return PlacementProblem(
        loaded=loaded,
        workspace=workspace,
        is_open=is_open,
        region=region,
        scene=scene,
        moving=Scene.build(loaded, with_bin=True, bin_moves=True),
        still_camera=still_camera(scene),
        tolerance=_tolerance(loaded, choice, supports),
        faces=faces,
        supports=supports,
        keep_scan=keep_scan,
        fit=fit,
        evaluator=evaluator,
        drop_offs=DropOffRoom(scene) if cell.drop_offs else None,
        picks=PickRoom(scene) if cell.bins else None,
    )


def _tolerance(
    loaded: LoadedCell, choice: PlacementChoice, supports: Sequence[TopFace]
) -> Tolerance:
    """Tolerance from the user, or else from the cell."""
    given = loaded.cell.placement.tolerance
    shift_m, turn_deg = choice.tolerance or (given.shift_m, given.turn_deg)
    turn_rad = float(np.radians(turn_deg))
    return Tolerance(shift_m=shift_m, turn_rad=turn_rad, floats=not supports)


def _region(
    loaded: LoadedCell, workspace: WorkspaceMap, choice: PlacementChoice
) -> Region:
    if loaded.cell.bin_scan.orientations.reference == "robot_base":
        raise SettingsError(
            "bin_scan.orientations.reference is robot_base: test grasps that do not "
            "turn with the bin cannot be placed (world and bin can)"
        )
    layers = loaded.cell.bin_scan.layers
    heights = np.array([workspace.z.min() - min(layers), workspace.z.max()])
    fixed = {
        name: float(np.radians(value)) if name == "yaw" else value
        for name, value in choice.fixed.items()
    }
    return region_of(
        loaded.cell.placement,
        {"x": workspace.x, "y": workspace.y, "z": heights},
        limits=choice.limits,
        fixed=fixed,
    )


def _decide(problem: PlacementProblem, choice: PlacementChoice) -> Decision:
    if choice.bin_pose is not None:
        x, y, z, yaw_deg = choice.bin_pose
        pose: Pose = (x, y, z, float(np.radians(yaw_deg)))
        return decide_as_given(problem, pose)
    if choice.rule == "paper":
        return decide_by_paper(problem)
    return decide_by_search(problem, choice.top)


def _settings(
    placed: LoadedCell, outcome: Outcome, choice: PlacementChoice, limit: ToolLimit
) -> dict[str, Any]:
    """Settings of the placement, and the limit of the tool."""
    return placement_settings() | {
        "top": choice.top,
        "limits": {k: list(v) for k, v in choice.limits.items()},
        "fixed": dict(choice.fixed),
        "scan_configuration": "new" if outcome.scan.is_new else "kept",
        "figure": FIGURES[placed.cell.tool.roll != LISTED],
        "tool_limit_percent": round(limit.percent, 2),
        "tool_limit_body": limit.body,
        "tool_limit_gains": limit.gains,
    }


def _record(
    problem: PlacementProblem,
    decision: Decision,
    outcome: Outcome,
    choice: PlacementChoice,
    clock: RunClock,
) -> BinPlacement:
    table, names = decision.table, problem.scene.robot.joint_names
    T_base_bin = problem.T_base_bin(table.rows[outcome.chosen].pose)
    q = np.array(outcome.scan.q)
    placed = problem.loaded.with_changes(
        bin_pose=T_base_bin,
        scan_configuration_rad=dict(zip(names, q.tolist(), strict=True)),
    )
    scene = Scene.shared(placed, with_bin=True)
    scene.require_free_scan_configuration()
    limit = tool_limit(scene.robot, placed, problem.is_open)
    rule = "given" if choice.bin_pose is not None else choice.rule
    document = scan_document(
        scene,
        kind="bin_placement",
        method=rule,
        settings={
            **checking_settings(scene),
            "roadmap": placed.cell.roadmap.model_dump(mode="json"),
            "placement": _settings(placed, outcome, choice, limit),
        },
        source_sha256=problem.workspace.stamp.content_sha256,
    )
    return BinPlacement(
        bin_pose=T_base_bin,
        scan_configuration=q,
        chosen=outcome.chosen,
        runner_up=outcome.runner_up,
        paper_choice=outcome.paper_choice,
        rule=rule,
        candidate_pose=table.poses(),
        tolerance=(problem.tolerance.shift_m, problem.tolerance.turn_rad),
        worst_score=table.worst(),
        score_error=table.values("error"),
        support=problem.support(table.rows[outcome.chosen].pose),
        T_world_base=placed.cell.robot.base_pose.matrix(),
        T_base_level=placed.cell.T_base_level(),
        score=table.values("score"),
        worst_point=table.values("worst_point"),
        reachable_share=table.values("reachable_share"),
        exact=table.exact(),
        reason=table.reasons(),
        margin=outcome.margin,
        joint_names=names,
        stamp=Stamp(**document["stamp"]),
        provenance=provenance_from_document(document),
        run=clock.finish(),
    )
