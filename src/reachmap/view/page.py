"""One self-contained page with playback: the 3-D view without a server."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.solids import SolidCell
from reachmap.geometry import yaw_transform
from reachmap.maps.any_file import Artefact
from reachmap.maps.records import BinMap, BinPlacement, WorkspaceMap
from reachmap.view.engine import start_server, stop_server
from reachmap.view.page_frame import framed
from reachmap.view.playback import Playback, choose_paths, playback_of
from reachmap.view.points import MapPoints, points_of
from reachmap.view.stage import Stage
from reachmap.view.words import has_bin, headline, legend_name

PAUSE_S, LEVEL_S = 0.7, 1.6


def page_of(record: Artefact | None, cell: SolidCell, paths: Sequence[int] = ()) -> str:
    """Write an artefact as a page that needs nothing but a browser.

    A bin map plays stored paths from the scan configuration to their grasps, in the
    time they take; a workspace map shows its levels one after another, with the arm at
    the best point of each; a placement shows the bin, the runner-up and all places.

    Parameters
    ----------
    record : WorkspaceMap, BinMap, BinPlacement or None
        None for a cell alone.
    cell : SolidCell
        Of the artefact.
    paths : sequence of int
        Rows of a bin map's paths to play; by default one of median length in each
        quadrant.

    Raises
    ------
    MissingExtraError
        The viewer is not installed.
    """
    server = start_server(0)
    try:
        stage = Stage(server, cell, glass_bin=not has_bin(record))
        points = points_of(record)
        if isinstance(record, BinMap):
            text = _bin_page(server, stage, points, record, paths)
        elif isinstance(record, WorkspaceMap):
            text = _workspace_page(server, stage, points, record)
        elif record is None:
            text = str(server.get_scene_serializer().as_html())
        else:
            text = _placement_page(server, stage, points, record)
    finally:
        stop_server(server)
    return framed(
        text,
        title=headline(record),
        subtitle=cell.loaded.cell.name,
        scale=legend_name(record),
    )


def _bin_page(
    server: Any,
    stage: Stage,
    points: MapPoints,
    record: BinMap,
    paths: Sequence[int],
) -> str:
    stage.put_points(points, np.arange(len(points.position)), points.main)
    played = [
        playback_of(record, row, stage.cell.robot)
        for row in (paths or choose_paths(record))
    ]
    shown = []
    for number, playback in enumerate(played):
        tcp = np.array([stage.cell.tcp_pose(q)[:3, 3] for q in playback.configuration])
        way = stage.put_way(
            tcp[: playback.grasp + 1], name=f"/way_{number}", visible=False
        )
        label = stage.put_label(
            f"Path {number + 1} of {len(played)}: {_path_words(playback)}",
            name=f"/label_{number}",
            visible=False,
        )
        shown.append((way, label))
    recording = server.get_scene_serializer()
    for playback, handles in zip(played, shown, strict=True):
        _show(handles, visible=True)
        _play(recording, stage, playback)
        _show(handles, visible=False)
    return str(recording.as_html())


def _path_words(playback: Playback) -> str:
    layer, y, x, orientation = playback.test_grasp
    return (
        f"test grasp {layer},{y},{x},{orientation} and back out, "
        f"{playback.time_s[-1]:.2f} s"
    )


def _play(recording: Any, stage: Stage, playback: Playback) -> None:
    stage.take(playback.configuration[0])
    recording.insert_sleep(PAUSE_S)
    for index in range(1, len(playback.configuration)):
        stage.take(playback.configuration[index])
        step = playback.time_s[index] - playback.time_s[index - 1]
        recording.insert_sleep(float(step))
        if index == playback.grasp:
            recording.insert_sleep(PAUSE_S)
    recording.insert_sleep(PAUSE_S)


def _show(handles: Sequence[Any], *, visible: bool) -> None:
    for handle in handles:
        if handle is not None:
            handle.visible = visible


def _workspace_page(
    server: Any, stage: Stage, points: MapPoints, record: WorkspaceMap
) -> str:
    everything = np.arange(len(points.position))
    whole = stage.put_points(
        points, everything, points.main, name="/points/all", scale=0.55
    )
    shown = []
    for level, name in enumerate(points.levels):
        here = points.chosen(level)
        balls = stage.put_points(
            points, here, points.main, name=f"/points/level_{level}", visible=False
        )
        mean = float(np.nanmean(points.main[here])) if _known(points, here) else np.nan
        label = stage.put_label(
            f"{name}: {mean:.1f} % path reachability on average",
            name=f"/label_{level}",
            visible=False,
        )
        shown.append((balls, label))
    recording = server.get_scene_serializer()
    recording.insert_sleep(LEVEL_S)
    _show([whole], visible=False)
    for level, handles in enumerate(shown):
        _show(handles, visible=True)
        q = _best_goal(points, level)
        if q is not None:
            stage.take(q)
        recording.insert_sleep(LEVEL_S)
        _show(handles, visible=False)
    _show([whole], visible=True)
    stage.take(record.scan_configuration)
    recording.insert_sleep(LEVEL_S)
    return str(recording.as_html())


def _known(points: MapPoints, here: Any) -> bool:
    return bool((~np.isnan(points.main[here])).any())


def _best_goal(points: MapPoints, level: int) -> FloatArray | None:
    """Give a goal configuration at the point of a level that is reached best."""
    frames, here = points.frames, points.chosen(level)
    if frames is None or not _known(points, here):
        return None
    best = int(here[int(np.nanargmax(points.main[here]))])
    goals = frames.goal[points.frames_at(best)]
    known = goals[~np.isnan(goals).any(axis=1)]
    return known[0] if len(known) else None


def _placement_page(
    server: Any, stage: Stage, points: MapPoints, record: BinPlacement
) -> str:
    stage.put_points(points, np.arange(len(points.position)), points.main, scale=0.7)
    if record.runner_up >= 0:
        x, y, z, yaw = (float(v) for v in record.candidate_pose[record.runner_up])
        stage.put_ghost_bin(yaw_transform(x, y, z, yaw), name="runner_up")
    stage.put_label("The bin as chosen; glass: the runner-up", name="/l")
    recording = server.get_scene_serializer()
    recording.insert_sleep(LEVEL_S)
    return str(recording.as_html())
