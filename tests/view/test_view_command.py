"""``reachmap view``: one page, the live view, and what is refused."""

from __future__ import annotations

import base64
import json
import re
import shutil
import socket
import sys
import threading
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

from reachmap.cli import group
from reachmap.core.collision.solids import SolidCell
from reachmap.errors import MissingExtraError
from reachmap.maps import write_bin_map, write_workspace_map
from reachmap.maps.provenance import cell_of_artefact
from reachmap.tools.view import ViewOptions, view
from reachmap.view.inspect_frame import best_first
from tests.support.synthetic_maps import synthetic_placement
from tests.support.toy_artefacts import toy_bin_map, toy_workspace

pytest.importorskip("viser")


def run(*arguments: str) -> Result:
    """Run the command in this process."""
    return CliRunner().invoke(group, ["view", *arguments])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A current folder with maps of the toy arm."""
    monkeypatch.chdir(tmp_path)
    write_bin_map(tmp_path / "bin.h5", toy_bin_map())
    write_workspace_map(tmp_path / "workspace.h5", toy_workspace())
    return tmp_path


@pytest.mark.parametrize("name", ["bin", "workspace"])
def test_a_page_needs_nothing_else(folder: Path, name: str) -> None:
    """It holds the scene, names no address but name spaces, and forbids them all."""
    result = run(f"{name}.h5", "--html", "page.html")
    assert result.exit_code == 0, result.output
    assert result.output == "page.html\n"
    page = (folder / "page.html").read_text()
    assert "__VISER_EMBED_DATA__" in page
    assert set(re.findall(r"https?://[^\s\"'`)<>\\/]+", page)) <= {"http://www.w3.org"}
    assert "default-src 'none'" in page
    assert not re.search(
        r"<(script|link|img|iframe)[^>]+(src|href)=[\"'](?!data:)", page
    )
    assert "planar-toy" in page


def test_a_page_holds_the_playback(folder: Path) -> None:
    """Longer paths make a larger recording; the stated path is the one played."""
    index = toy_bin_map().paths.index
    chosen = ",".join(str(i) for i in index[0][:4])
    assert run("bin.h5", "--html", "one.html", "--path", chosen).exit_code == 0
    assert run("bin.h5", "--html", "all.html").exit_code == 0

    def scene_size(name: str) -> int:
        text = (folder / name).read_text()
        data = re.search(r'__VISER_EMBED_DATA__="([^"]*)"', text)
        assert data is not None
        return len(base64.b64decode(data[1]))

    assert scene_size("one.html") < scene_size("all.html")


def test_a_page_is_not_overwritten(folder: Path) -> None:
    """Unless that is asked for."""
    (folder / "page.html").write_text("mine")
    result = run("bin.h5", "--html", "page.html")
    assert result.exit_code != 0
    assert (folder / "page.html").read_text() == "mine"


@pytest.mark.parametrize("value", ["1,2,3", "a,b,c,d", "0,0,0,-1", "0,0,0,0,0"])
def test_a_test_grasp_is_four_numbers(folder: Path, value: str) -> None:
    """Anything else is wrong usage."""
    result = run("bin.h5", "--path", value, "--html", "x.html")
    assert result.exit_code == 2
    assert "LAYER,Y,X,ORIENTATION" in result.output


def test_only_bin_maps_have_paths(folder: Path) -> None:
    """A workspace map keeps none."""
    with pytest.raises(Exception, match="--path is for bin maps"):
        view(Path("workspace.h5"), page=Path("x.html"), test_grasps=[(0, 0, 0, 0)])


def test_the_missing_extra_is_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without viser there is one line that says how to get it."""
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(MissingExtraError, match=r"reachmap-cells\[view\]"):
        view(Path("bin.h5"), page=Path("x.html"))


def test_the_live_view_is_for_this_machine_alone(folder: Path) -> None:
    """It answers on the loopback address while it runs, and says where."""
    told: list[str] = []
    answers: list[bytes] = []

    def look() -> None:
        with urllib.request.urlopen(told[0]) as page:
            answers.append(page.read(200))

    view(
        Path("workspace.h5"),
        options=ViewOptions(port=0),
        on_ready=told.append,
        wait=look,
    )
    assert told[0].startswith("http://127.0.0.1:")
    assert b"<html" in answers[0]


def test_a_taken_port_is_refused(folder: Path) -> None:
    """Instead of silently using another one."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(Exception, match=f"port {port} cannot be used"):
            view(Path("bin.h5"), options=ViewOptions(port=port), wait=lambda: None)


@pytest.fixture
def app(request: pytest.FixtureRequest) -> Iterator[Any]:
    """The live view of a toy map, without a browser."""
    from reachmap.view.app import App
    from reachmap.view.engine import start_server, stop_server

    record = toy_bin_map() if request.param == "bin" else toy_workspace()
    server = start_server(0)
    cell = SolidCell.build(cell_of_artefact(record.provenance, "toy"))
    yield App(server, record, cell)
    stop_server(server)


@pytest.mark.parametrize("app", ["workspace"], indirect=True)
def test_a_click_moves_the_arm_and_reddens_bodies(app: Any) -> None:
    """A colliding frame turns its two bodies red; home makes them as they were."""
    frames = app.points.frames
    row = int(np.flatnonzero(frames.pair >= 0)[0])
    point = int(frames.point[row])
    before = app.stage._last.copy()
    app.show_point(point)
    app.show_frame(best_first(app.points, point).index(row))
    assert app.answer.blocking
    assert app.stage._red == set(app.answer.blocking)
    assert not np.allclose(app.stage._last, before)
    assert "touches" in app.caption.content
    app.go_home()
    assert not app.stage._red
    assert app.stage._last == pytest.approx(before)


@pytest.mark.parametrize("app", ["workspace"], indirect=True)
def test_filters_choose_the_points(app: Any) -> None:
    """The slider shows one level, the state only points that have it."""
    everything = len(app.points.position)
    assert len(app.shown) == everything
    app.state.value = "path found"
    app.refresh()
    reached = np.unique(app.points.frames.point[app.points.frames.status == 1])
    assert app.shown.tolist() == reached.tolist()
    assert f"{len(reached)} of {everything} points" in app.count.content


@pytest.mark.parametrize("app", ["workspace"], indirect=True)
def test_a_click_shows_a_frame_in_the_state_let_through(app: Any) -> None:
    """Who filters by a state wants to see why, not the frame that is reached."""
    name = "every IK solution in collision"
    app.state.value = name
    app.refresh()
    point = int(app.shown[-1])
    app.show_point(point)
    row = app._rows[int(app.frame.value)]
    assert app.points.frames.point[row] == point
    assert app.points.frames.status[row] == app.points.states()[name]


@pytest.mark.parametrize("app", ["workspace"], indirect=True)
def test_a_ray_means_the_nearest_point(app: Any) -> None:
    """From wherever it comes."""
    rng = np.random.default_rng(1)
    for point in (0, 10, 30):
        origin = app.points.position[point] + rng.normal(size=3)
        towards = app.points.position[point] - origin
        assert app.nearest(origin, 3.0 * towards) == point


@pytest.mark.parametrize("app", ["bin"], indirect=True)
def test_play_ends_at_the_end_of_the_path(app: Any) -> None:
    """The arm goes through the path and stands at its last configuration."""
    playback = app._playback()
    app.play_path(speed=1000.0)
    expected = app.cell.joint_poses(playback.configuration[-1])
    assert app.stage._last == pytest.approx(expected)


@pytest.mark.parametrize("app", ["bin"], indirect=True)
def test_a_click_ends_the_playback(app: Any) -> None:
    """Nobody waits for a slow path to finish."""
    player = threading.Thread(target=app.play_path, kwargs={"speed": 0.01})
    player.start()
    while not app._busy.locked():
        pass
    app.go_home()
    player.join(timeout=10)
    assert not player.is_alive()
    expected = app.cell.joint_poses(app.cell.scan_configuration)
    assert app.stage._last == pytest.approx(expected)


def test_names_are_escaped() -> None:
    """A name cannot put anything on the page."""
    from reachmap.view.app import _paragraph
    from reachmap.view.page import framed

    page = framed(
        "<html><head></head><body></body></html>",
        title="<script>alert(1)</script>",
        subtitle="a & b",
        scale="<i>",
    )
    assert "<script>alert" not in page
    assert "a &amp; b" in page
    assert "<img" not in _paragraph("<img src=x>", "<b>")


def test_a_placement_shows_chosen_bin_and_runner_up(tmp_path: Path) -> None:
    """A page without playback, in the shipped cell."""
    from reachmap.cell.loading import read_cell
    from reachmap.view.page import page_of

    loaded = read_cell("planar-toy")
    page = page_of(synthetic_placement(), SolidCell.build(loaded))
    assert json.dumps("Bin at")[1:-1] in page
    assert "score" in page


@pytest.mark.parametrize("name", ["planar-toy", "cell.yaml"])
def test_a_cell_can_be_looked_at_before_any_scan(folder: Path, name: str) -> None:
    """By its shipped name or as a file; there is no scale of colours then."""
    shipped = Path(__file__).parents[2] / "cells"
    (folder / "cell.yaml").write_bytes((shipped / "planar-toy.yaml").read_bytes())
    shutil.copytree(shipped / "planar-toy", folder / "planar-toy")
    result = run(name, "--html", "page.html")
    assert result.exit_code == 0, result.output
    page = (folder / "page.html").read_text()
    assert "At the scan configuration" in page
    assert 'id="reachmap-scale"' not in page
