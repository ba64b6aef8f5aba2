"""The live view: level slider, state filter, clicks, playback; one cell, one map."""

from __future__ import annotations

import html
import threading
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from reachmap._typing import FloatArray, IntArray
from reachmap.core.collision.solids import SolidCell
from reachmap.core.scene import Scene
from reachmap.errors import ReachmapError
from reachmap.maps.format.registry import Artefact
from reachmap.maps.records import BinMap, BinPlacement, WorkspaceMap
from reachmap.maps.summary.statistics import best_level
from reachmap.view.inspect_frame import Answer, answer, best_first
from reachmap.view.page import has_bin, headline
from reachmap.view.playback import Playback, choose_paths, playback_of
from reachmap.view.points import EVERYTHING, points_of
from reachmap.view.stage import Stage

if TYPE_CHECKING:
    import viser

ALL_LEVELS = "all levels"
HINT = "Click a point to put the arm there."


class App:
    """Reacts to what the user does in the browser.

    Parameters
    ----------
    server : viser.ViserServer
    record : WorkspaceMap, BinMap, BinPlacement or None
        None for a cell alone.
    cell : SolidCell
        Of the artefact.
    path : int, optional
        Row of the path that "play" plays first.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        record: Artefact | None,
        cell: SolidCell,
        path: int | None = None,
    ) -> None:
        self.server: Any = server
        self.record = record
        self.cell = cell
        self.stage = Stage(server, cell, glass_bin=not has_bin(record))
        self.points = points_of(record)
        self.shown: IntArray = np.arange(len(self.points.position))
        self.answer: Answer | None = None
        self.path = path
        self._rows: list[int] = []
        self._scenes: dict[str, Scene] = {}
        self._balls: Any = None
        self._way: Any = None
        self._busy = threading.Lock()
        self._stop = threading.Event()
        if isinstance(record, BinPlacement) and record.runner_up >= 0:
            self.stage.put_runner_up(
                record.T_base_level @ record.T_level_bin(record.runner_up)
            )
        self._build_panel()
        self.refresh()

    def _build_panel(self) -> None:
        gui = self.server.gui
        gui.add_html(_paragraph(headline(self.record), self.cell.loaded.cell.name))
        best = self._best_level()
        has_points = len(self.points.position) > 0
        with gui.add_folder("Points", visible=has_points):
            last = len(self.points.levels) - 1
            self.level: Any = gui.add_slider(
                "level", min=0, max=max(last, 1), step=1, initial_value=best or 0,
                disabled=last < 1,
            )  # fmt: skip
            self.all_levels: Any = gui.add_checkbox(
                ALL_LEVELS, initial_value=best is None
            )
            self.quantity: Any = gui.add_dropdown(
                "colour", options=tuple(self.points.shares)
            )
            self.state: Any = gui.add_dropdown(
                "with a frame", options=(EVERYTHING, *self.points.states())
            )
            self.count: Any = gui.add_html("")
        with gui.add_folder("Arm", visible=has_points):
            self.frame: Any = gui.add_slider(
                "orientation", min=0, max=1, step=1, initial_value=0, disabled=True
            )
            self.caption: Any = gui.add_html(_paragraph(HINT))
            self.play: Any = gui.add_button(
                "Play the path", disabled=not isinstance(self.record, BinMap)
            )
            self.home: Any = gui.add_button("Scan configuration")
        self.level.on_update(lambda _: self._on_level())
        for control in (self.all_levels, self.quantity, self.state):
            control.on_update(lambda _: self.refresh())
        self.frame.on_update(lambda _: self.show_frame(int(self.frame.value)))
        self.play.on_click(lambda _: self.play_path())
        self.home.on_click(lambda _: self.go_home())

    def _best_level(self) -> int | None:
        """Level to begin with; None for all of them."""
        if isinstance(self.record, WorkspaceMap):
            return best_level(self.record.path_reachability)
        return None

    def _on_level(self) -> None:
        # Whoever moves the slider wants to see one level.
        if self.all_levels.value:
            self.all_levels.value = False
        self.refresh()

    def refresh(self) -> None:
        """Draw the points that level and state let through, in the chosen colours."""
        level = None if self.all_levels.value else int(self.level.value)
        self.shown = self.points.chosen(level, str(self.state.value))
        if self._balls is not None:
            self._balls.remove()
        values = self.points.shares[str(self.quantity.value)]
        self._balls = self.stage.put_points(self.points, self.shown, values)
        if self._balls is not None:
            self._balls.on_click(self._on_click)
        where = ALL_LEVELS if level is None else self.points.levels[level]
        known = values[self.shown][~np.isnan(values[self.shown])]
        mean = f", {known.mean():.1f} % on average" if len(known) else ""
        self.count.content = _paragraph(
            "", f"{where}: {len(self.shown)} of {len(values)} points{mean}"
        )

    def _on_click(self, event: Any) -> None:
        if event.instance_index is not None and event.instance_index < len(self.shown):
            point = int(self.shown[event.instance_index])
        else:
            point = self.nearest(
                np.array(event.ray_origin), np.array(event.ray_direction)
            )
        self.show_point(point)

    def nearest(self, origin: FloatArray, direction: FloatArray) -> int:
        """Point shown that is nearest to a ray, each given as (3,)."""
        away = self.points.position[self.shown] - origin
        along = away @ direction / float(direction @ direction)
        aside = np.linalg.norm(away - along[:, None] * direction, axis=1)
        return int(self.shown[int(aside.argmin())])

    def show_point(self, point: int) -> None:
        """Put the arm to the best test frame of a point, or the best in the state."""
        self._rows = best_first(self.points, point)
        if not self._rows:
            share = self.points.main[point]
            said = "excluded" if np.isnan(share) else f"score {share:.1f} %"
            self.caption.content = _paragraph(said, _place(self.points.position[point]))
            return
        self.frame.max = max(len(self._rows) - 1, 1)
        self.frame.disabled = len(self._rows) < 2
        first = self._first_in_state()
        if int(self.frame.value) != first:
            self.frame.value = first
        self.show_frame(first)

    def _first_in_state(self) -> int:
        """Place among the point's frames of the first in the state let through."""
        code = self.points.states().get(str(self.state.value))
        frames = self.points.frames
        if code is None or frames is None:
            return 0
        return int(np.argmax(frames.status[self._rows] == code))

    def show_frame(self, number: int) -> None:
        """Show one test frame of the chosen point: the arm there, contacts in red."""
        if not self._rows:
            return
        self._stop.set()
        with self._busy:
            row = self._rows[min(number, len(self._rows) - 1)]
            frames = self.points.frames
            assert frames is not None
            level = int(self.points.level[frames.point[row]])
            pairs = getattr(self.record, "body_pairs", ())
            shown = answer(self.points, row, pairs, self._solver(level))
            self.answer = shown
            self._put_way(None)
            self.stage.put_axes(shown.T_base_tcp)
            if shown.configuration is not None:
                self.stage.take(shown.configuration)
            self.stage.redden(shown.blocking if shown.configuration is not None else ())
            self.path = shown.path if shown.path >= 0 else self.path
            where = _place(shown.T_base_tcp[:3, 3])
            self.caption.content = _paragraph(
                shown.text, f"{where}, orientation {number + 1} of {len(self._rows)}"
            )

    def go_home(self) -> None:
        """Put the arm back to the scan configuration."""
        self._stop.set()
        with self._busy:
            self.answer = None
            self._put_way(None)
            self.stage.redden()
            self.stage.put_axes(None)
            self.stage.take(self.cell.scan_configuration)
            self.caption.content = _paragraph(HINT)

    def play_path(self, speed: float = 1.0) -> None:
        """Play the path to the test grasp shown, or one worth watching."""
        playback = self._playback()
        if playback is None:
            return
        self._stop.set()
        with self._busy:
            self._stop.clear()
            self.stage.redden()
            self._put_way(playback)
            said = (
                "the whole cycle" if playback.has_cycle else "to the grasp and back out"
            )
            self.caption.content = _paragraph(
                f"Path of {playback.time_s[-1]:.2f} s", said
            )
            began = time.monotonic()
            for index, when in enumerate(playback.time_s):
                if self._stop.wait(
                    max(0.0, began + float(when) / speed - time.monotonic())
                ):
                    return
                self.stage.take(playback.configuration[index], playback.part_at(index))

    def _playback(self) -> Playback | None:
        if not isinstance(self.record, BinMap):
            return None
        rows = choose_paths(self.record) if self.path is None else (self.path,)
        return playback_of(self.record, rows[0], self.cell.robot) if rows else None

    def _put_way(self, playback: Playback | None) -> None:
        if self._way is not None:
            self._way.remove()
            self._way = None
        if playback is not None:
            there = playback.configuration[: playback.release + 1]
            tcp = np.array([self.cell.tcp_pose(q)[:3, 3] for q in there])
            self._way = self.stage.put_way(tcp, name="/way")

    def _solver(self, level: int) -> Scene | None:
        """Scene that finds colliding configurations again; built when first needed.

        Of a map with levels of filling it is that of the level.
        """
        fillings = self.cell.loaded.fillings() if has_bin(self.record) else ()
        loaded = fillings[level] if len(fillings) > 1 else self.cell.loaded
        if loaded.sha256 not in self._scenes:
            try:
                found = Scene.build(loaded, with_bin=has_bin(self.record))
            except ReachmapError:
                return None
            self._scenes[loaded.sha256] = found
        return self._scenes[loaded.sha256]


def _place(position: FloatArray) -> str:
    x, y, z = position.round(3) + 0.0
    return f"x {x:+.3f}, y {y:+.3f}, z {z:+.3f} m"


def _paragraph(first: str, second: str = "") -> str:
    """Two lines of plain text as HTML, the first in bold."""
    return (
        '<div style="padding: 0 0.7em; font-size: 0.86em; line-height: 1.45">'
        f"<b>{html.escape(first)}</b>"
        f"{'<br>' if first and second else ''}"
        f'<span style="opacity: 0.75">{html.escape(second)}</span></div>'
    )
