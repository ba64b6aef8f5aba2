"""One self-contained page with playback: the 3-D view without a server."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from reachmap._typing import FloatArray
from reachmap.core.collision.solids import SolidCell
from reachmap.maps.format.registry import Artefact
from reachmap.maps.records import BinMap, BinPlacement, WorkspaceMap
from reachmap.maps.summary.statistics import best_level, level_means, saturation_of
from reachmap.plots.parts.style import colour_map
from reachmap.plots.placement import placement_titles
from reachmap.view.engine import start_server, stop_server
from reachmap.view.playback import Playback, choose_paths, playback_of
from reachmap.view.points import MapPoints, points_of
from reachmap.view.stage import Stage


def headline(record: Artefact | None) -> str:
    """Answer of a map: best level, share of test grasps, or where the bin goes."""
    if record is None:
        return "At the scan configuration"
    if isinstance(record, WorkspaceMap):
        best = best_level(record.path_reachability)
        if best is None:
            return "Workspace map, nothing attempted"
        mean = float(level_means(record.path_reachability)[best])
        z = float(record.z[best]) + 0.0
        return f"Workspace map: best level z = {z:.2f} m, {mean:.1f} %"
    if isinstance(record, BinMap):
        found = saturation_of(record)
        return f"Bin map: {found.share[-1]:.1f} % of {found.total} test grasps reached"
    return placement_titles(record)[0]


def has_bin(record: Artefact | None) -> bool:
    """Whether the bin was among the obstacles; a workspace is mapped without it."""
    if record is None:
        return True
    standing = record.provenance.settings.get("with_bin")
    if isinstance(standing, bool):
        return standing
    return not isinstance(record, WorkspaceMap)


def legend_name(record: Artefact | None) -> str:
    """What the colours of the points mean; "" where there are no points."""
    if record is None:
        return ""
    if isinstance(record, WorkspaceMap | BinMap):
        return "path reachability"
    return "score"


# Choices by eye: long enough to look, short enough not to wait.
PAUSE_S, LEVEL_S = 0.7, 1.6


def page_of(record: Artefact | None, cell: SolidCell, paths: Sequence[int] = ()) -> str:
    """Write an artefact as a page that needs only a browser.

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
            tcp[: playback.release + 1], name=f"/way_{number}", visible=False
        )
        label = stage.put_label(
            f"Path {number + 1} of {len(played)}: {_path_caption(playback)}",
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


def _path_caption(playback: Playback) -> str:
    layer, y, x, orientation = playback.test_grasp
    after = "whole cycle" if playback.has_cycle else "and back out"
    return (
        f"test grasp {layer},{y},{x},{orientation} {after}, {playback.time_s[-1]:.2f} s"
    )


def _play(recording: Any, stage: Stage, playback: Playback) -> None:
    stage.take(playback.configuration[0], playback.part_at(0))
    recording.insert_sleep(PAUSE_S)
    for index in range(1, len(playback.configuration)):
        stage.take(playback.configuration[index], playback.part_at(index))
        step = playback.time_s[index] - playback.time_s[index - 1]
        recording.insert_sleep(float(step))
        if index in (playback.grasp, playback.release):
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
        stage.put_runner_up(record.T_base_level @ record.T_level_bin(record.runner_up))
    stage.put_label("The bin as chosen; glass: the runner-up", name="/l")
    recording = server.get_scene_serializer()
    recording.insert_sleep(LEVEL_S)
    return str(recording.as_html())


# A choice: colours of the gradient that stands for the scale, one at every quarter.
STEPS = 5
# The page may run its own scripts and nothing else: no address is ever contacted.
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' data: blob:; "
    "style-src 'unsafe-inline' data:; img-src data: blob:; font-src data:; "
    "media-src data: blob:; worker-src data: blob:; connect-src data: blob:"
)
CAPTION = """
<style>
#reachmap-caption {{
  position: fixed; left: 14px; bottom: 58px; z-index: 30; max-width: min(440px, 60vw);
  padding: 10px 14px; border-radius: 8px; background: rgba(255, 255, 255, 0.9);
  box-shadow: 0 1px 6px rgba(0, 0, 0, 0.18); color: #1c1c1c;
  font: 13px/1.4 system-ui, "DejaVu Sans", sans-serif; pointer-events: none;
}}
#reachmap-caption b {{ display: block; font-size: 15px; }}
#reachmap-caption span {{ color: #5f5f5f; }}
#reachmap-scale {{
  height: 10px; margin-top: 8px; border-radius: 2px;
  background: linear-gradient(90deg, {stops});
}}
#reachmap-ends {{ display: flex; justify-content: space-between; color: #5f5f5f; }}
#reachmap-ends i {{ font-style: normal; }}
</style>
<div id="reachmap-caption"><b>{title}</b><span>{subtitle}</span>
{scale}</div>
"""
SCALE = """<div id="reachmap-scale"></div>
<div id="reachmap-ends"><i>0 %</i><i>{name}</i><i>100 %</i></div>
"""


def framed(page: str, *, title: str, subtitle: str, scale: str) -> str:
    """Add a caption to a viewer's page, and a policy that forbids every address.

    Parameters
    ----------
    page : str
        HTML of a recorded scene.
    title, subtitle, scale : str
        Plain text: what is shown, of which cell, and what the colours mean; without
        a scale none is drawn.
    """
    colours = colour_map("RdYlGn")
    stops = ", ".join(
        "rgb({:.0f}, {:.0f}, {:.0f})".format(*(255.0 * v for v in colours(share)[:3]))
        for share in (step / (STEPS - 1) for step in range(STEPS))
    )
    caption = CAPTION.format(
        title=html.escape(title),
        subtitle=html.escape(subtitle),
        scale=SCALE.format(name=html.escape(scale)) if scale else "",
        stops=stops,
    )
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f"<title>{html.escape(title)}</title>"
    )
    # Only the viewer's own head and body, not the same words in its scripts.
    page = re.sub(r"<title>[^<]*</title>", "", page, count=1)
    start = page.index("<head>") + len("<head>")
    page = page[:start] + head + page[start:]
    end = page.rindex("</body>")
    return page[:end] + caption + page[end:]
