"""The 3-D view in a real browser: it shows something, it moves, it asks nobody."""

from __future__ import annotations

import functools
import threading
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reachmap.maps import write_bin_map, write_workspace_map
from reachmap.tools.view import ViewOptions, view
from reachmap.view.engine import start_server, stop_server
from tests.support.chromium import Page, chromium, find_chromium
from tests.support.toy_artefacts import toy_bin_map, toy_workspace

pytest.importorskip("viser")

pytestmark = [
    pytest.mark.browser,
    pytest.mark.slow,
    pytest.mark.skipif(
        find_chromium() is None,
        reason="no Chromium here (Debian: apt-get install chromium)",
    ),
]


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    """One browser for all tests of this module."""
    with chromium(tmp_path_factory.mktemp("profile")) as page:
        yield page


def until(page: Page, condition: Any, seconds: float = 40.0) -> bool:
    """Wait for a condition; software rendering takes its time."""
    for _ in range(int(2 * seconds)):
        if condition():
            return True
        page.wait(0.5)
    return False


def inner(picture: np.ndarray) -> np.ndarray:
    """Middle of the picture, without caption, messages and play bar."""
    return picture[170:600, 60:940]


def is_drawn(page: Page) -> bool:
    """Whether the middle has many colours, the bin's blue among them."""
    middle = inner(page.picture())
    blue = (middle[..., 2] > middle[..., 0] + 60) & (middle[..., 2] > 120)
    return len(np.unique(middle.reshape(-1, 3), axis=0)) > 200 and blue.mean() > 0.01


def outside(page: Page) -> list[str]:
    """Addresses that were asked for and are not of this machine."""
    own = ("file://", "data:", "blob:", "about:", "http://127.0.0.1:", "chrome:")
    return [address for address in page.requests if not address.startswith(own)]


def test_the_page_plays_paths(browser: Page, tmp_path: Path) -> None:
    """From a file, without a server: not blank, moving, and asking nobody."""
    write_bin_map(tmp_path / "bin.h5", toy_bin_map())
    view(tmp_path / "bin.h5", page=tmp_path / "page.html")
    browser.open(f"file://{tmp_path / 'page.html'}", 2.0)
    assert until(browser, lambda: is_drawn(browser))
    first = inner(browser.picture())

    def moved() -> bool:
        changed = np.abs(inner(browser.picture()) - first).max(axis=-1) > 40
        return bool(changed.mean() > 0.002)

    assert until(browser, moved)
    assert not outside(browser)
    assert not browser.errors
    assert "Bin map" in browser.evaluate("document.title")


def test_a_click_on_a_point_moves_the_arm(
    browser: Page, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The live view in the browser, clicked where a ball is drawn."""
    write_workspace_map(tmp_path / "workspace.h5", toy_workspace())
    apps: list[Any] = []
    start = "reachmap.view.app.App.__init__"
    from reachmap.view.app import App

    original = App.__init__

    def remember(self: App, *arguments: Any) -> None:
        original(self, *arguments)
        apps.append(self)

    monkeypatch.setattr(start, remember)
    ready, done = threading.Event(), threading.Event()
    told: list[str] = []

    def on_ready(address: str) -> None:
        told.append(address)
        ready.set()

    thread = threading.Thread(
        target=view,
        args=(tmp_path / "workspace.h5",),
        kwargs={
            "options": ViewOptions(port=0),
            "on_ready": on_ready,
            "wait": done.wait,
        },
    )
    thread.start()
    try:
        assert ready.wait(30)
        browser.open(told[0], 3.0)
        assert until(browser, lambda: green_place(browser) is not None)

        def answered() -> bool:
            place = green_place(browser)
            if place is not None and apps[0].answer is None:
                browser.click(*place)
            return apps[0].answer is not None

        assert until(browser, answered)
        assert not outside(browser)
    finally:
        done.set()
        thread.join()


def green_place(page: Page) -> tuple[float, float] | None:
    """Middle of a ball of high reachability, in pixels; None where there is none."""
    picture = page.picture()
    green = (picture[..., 1] > picture[..., 0] + 50) & (
        picture[..., 1] > picture[..., 2] + 30
    )
    green[:170], green[:, 640:] = False, False
    window = np.lib.stride_tricks.sliding_window_view(green, (5, 5))
    solid = np.argwhere(window.all(axis=(-1, -2)))
    if not len(solid):
        return None
    y, x = solid[len(solid) // 2] + 2
    return float(x), float(y)


TRY = """new Promise(done => {
  const socket = new WebSocket("ws://127.0.0.1:%d/", ["viser-v1.1.1"]);
  socket.onopen = () => done("opened");
  socket.onerror = () => done("refused");
})"""


def test_a_foreign_page_gets_no_socket(browser: Page, tmp_path: Path) -> None:
    """The browser's own word on where a page comes from decides, not the page's."""
    (tmp_path / "index.html").write_text("<title>elsewhere</title>")
    handler = functools.partial(SimpleHTTPRequestHandler, directory=str(tmp_path))
    foreign = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=foreign.serve_forever).start()
    server = start_server(0)
    port = server.get_port()
    try:
        for address, expected in (
            (f"http://127.0.0.1:{port}/", "opened"),
            (f"http://127.0.0.1:{foreign.server_port}/", "refused"),
            (f"http://localhost:{foreign.server_port}/", "refused"),
            (f"file://{tmp_path / 'index.html'}", "refused"),
        ):
            browser.open(address, 1.0)
            assert browser.evaluate(TRY % port, promised=True) == expected, address
    finally:
        stop_server(server)
        foreign.shutdown()
        foreign.server_close()


def test_a_shared_view_is_drawn_with_its_token(browser: Page, tmp_path: Path) -> None:
    """The page hands the token on to its socket; without it there is no page."""
    write_workspace_map(tmp_path / "workspace.h5", toy_workspace())
    ready, done = threading.Event(), threading.Event()
    told: list[str] = []

    def on_ready(address: str) -> None:
        told.append(address)
        ready.set()

    thread = threading.Thread(
        target=view,
        args=(tmp_path / "workspace.h5",),
        kwargs={
            "options": ViewOptions(host="0.0.0.0", port=0),
            "on_ready": on_ready,
            "wait": done.wait,
        },
    )
    thread.start()
    try:
        assert ready.wait(30)
        bare = told[0].partition("?")[0]
        browser.open(bare, 1.0)
        assert "with its token" in browser.evaluate("document.body.innerText")
        browser.open(told[0], 3.0)
        assert until(browser, lambda: green_place(browser) is not None)
    finally:
        done.set()
        thread.join()
