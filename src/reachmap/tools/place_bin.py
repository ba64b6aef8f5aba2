"""``place-bin``: a workspace map goes in, the pose of the bin comes out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.bin_fit import BinFit
from reachmap.core.scene import Scene
from reachmap.errors import SceneError
from reachmap.geometry import yaw_transform
from reachmap.maps import (
    BinPlacement,
    RunClock,
    WorkspaceMap,
    check_output,
    read_workspace_map,
    write_placement,
)
from reachmap.maps.records import Provenance, Stamp
from reachmap.placement.candidates import Candidate, CandidateTable
from reachmap.placement.exact import score_cell
from reachmap.placement.paper_rule import LatticePoint, choose_by_paper
from reachmap.placement.region import Region, region_of
from reachmap.scans.document import (
    checking_settings,
    provenance_from_document,
    roadmap_settings,
    scan_document,
)
from reachmap.tools.options import IN_PROCESS, RunOptions, cell_of_artefact, with_seed

if TYPE_CHECKING:
    from reachmap.cell.loading import LoadedCell

RULES = ("paper",)


def place_bin(
    workspace: Path,
    output: Path,
    *,
    rule: str = "paper",
    overrides: Sequence[str] = (),
    seed: int | None = None,
    run: RunOptions = IN_PROCESS,
) -> BinPlacement:
    """Choose where the bin stands.

    Parameters
    ----------
    workspace : Path
        Artefact of workspace-scan, which holds the cell.
    output : Path
        The artefact to write.
    rule : {"paper"}
    overrides : sequence of str
        ``key.path=value``.
    seed : int, optional
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
    check_output(output, overwrite=run.overwrite)
    clock = RunClock(workers=run.workers)
    workspace_map = read_workspace_map(workspace)
    loaded = cell_of_artefact(
        workspace_map.provenance, str(workspace), with_seed(overrides, seed)
    )
    with clock.phase("place"):
        placement = _place_by_paper(loaded, workspace_map, clock)
    write_placement(output, placement, overwrite=run.overwrite)
    return placement


def _place_by_paper(
    loaded: LoadedCell, workspace: WorkspaceMap, clock: RunClock
) -> BinPlacement:
    scene = Scene.build(loaded, with_bin=False)
    fit = BinFit(scene.robot, loaded, scene.scan_configuration)
    layer = float(np.mean(loaded.cell.bin_scan.layers))
    region = region_of(
        loaded.cell.placement, workspace.x, workspace.y, workspace.z - layer
    )
    pose = loaded.cell.bin.pose.matrix()
    yaw = float(np.arctan2(pose[1, 0], pose[0, 0]))
    table = CandidateTable()
    yaws = (yaw, yaw + np.pi / 2)

    def is_feasible(point: LatticePoint) -> bool:
        return any(_try(point, angle) for angle in yaws)

    def _try(point: LatticePoint, angle: float) -> bool:
        place = (
            float(workspace.x[point.x]),
            float(workspace.y[point.y]),
            float(workspace.z[point.z]) - layer,
            angle,
        )
        reason = _reason(place, region, fit)
        if reason:
            table.add(Candidate(pose=place, reason=reason))
            return False
        changed = loaded.with_changes(bin_pose=yaw_transform(*place))
        table.add(Candidate(pose=place, score=score_cell(changed), exact=True))
        return True

    if choose_by_paper(workspace, is_feasible) is None:
        raise SceneError(f"{loaded.source}: the bin can stand nowhere on the map")
    chosen = len(table.rows) - 1
    T = yaw_transform(*table.rows[chosen].pose)
    placed = loaded.with_changes(
        bin_pose=T, scan_configuration_rad=loaded.scan_configuration_rad
    )
    provenance, stamp = _stamped(placed, workspace, "paper")
    return BinPlacement(
        bin_pose=T,
        scan_configuration=scene.scan_configuration,
        chosen=chosen,
        runner_up=-1,
        paper_choice=chosen,
        rule="paper",
        candidate_pose=table.poses(),
        score=table.values("score"),
        worst_point=table.values("worst_point"),
        reachable_share=table.values("reachable_share"),
        exact=table.exact(),
        reason=table.reasons(),
        margin={},
        joint_names=scene.robot.joint_names,
        stamp=stamp,
        provenance=provenance,
        run=clock.finish(),
    )


def _reason(
    place: tuple[float, float, float, float], region: Region, fit: BinFit
) -> str:
    outside = region.outside(np.array(place))
    if outside:
        return f"{outside} is outside the region"
    contact = fit.contact(yaw_transform(*place))
    return "" if contact is None else contact.reason


def _stamped(
    placed: LoadedCell, workspace: WorkspaceMap, rule: str
) -> tuple[Provenance, Stamp]:
    scene = Scene.build(placed, with_bin=True)
    scene.require_free_scan_configuration()
    document = scan_document(
        scene,
        kind="bin_placement",
        method=rule,
        settings={
            **checking_settings(scene),
            "roadmap": roadmap_settings(),
        },
        source_sha256=workspace.stamp.content_sha256,
    )
    return provenance_from_document(document), Stamp(**document["stamp"])


def summary_of_placement(placement: BinPlacement) -> dict[str, Any]:
    """Headline of a placement: pose, score."""
    x, y, z, yaw = placement.candidate_pose[placement.chosen].tolist()
    return {
        "rule": placement.rule,
        "bin_pose_x_y_z_m": _rounded(np.array([x, y, z])),
        "yaw_deg": round(float(np.degrees(yaw)), 2),
        "score_percent": round(float(placement.score[placement.chosen]), 2),
        "worst_point_percent": round(float(placement.worst_point[placement.chosen]), 2),
        "candidates": len(placement.reason),
    }


def _rounded(values: FloatArray) -> list[float]:
    return [round(float(v), 4) + 0.0 for v in values]
