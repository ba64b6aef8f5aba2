"""A headless Chromium under remote control: pictures, requests, and clicks."""

from __future__ import annotations

import base64
import contextlib
import io
import json
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

NAMES = ("chromium", "chromium-browser", "google-chrome")
FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--hide-scrollbars",
    "--remote-debugging-port=0", "--window-size=1000,700",
)  # fmt: skip


def find_chromium() -> str | None:
    """Path of a Chromium, or None."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Page:
    """One tab; every address it asks for is kept in `requests`."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._number = 0
        self.requests: list[str] = []
        self.errors: list[str] = []
        for domain in ("Page", "Network", "Runtime"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """Send a command and wait for its answer."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        self._socket.send(json.dumps(message))
        while True:
            answer = json.loads(self._socket.recv(timeout=60))
            self._note(answer)
            if answer.get("id") == self._number:
                assert "error" not in answer, answer["error"]
                return dict(answer["result"])

    def _note(self, event: dict[str, Any]) -> None:
        if event.get("method") == "Network.requestWillBeSent":
            self.requests.append(event["params"]["request"]["url"])
        if event.get("method") == "Runtime.exceptionThrown":
            self.errors.append(str(event["params"]["exceptionDetails"].get("text")))

    def open(self, address: str, wait_s: float) -> None:
        """Go to an address and let it work for a while."""
        self.call("Page.navigate", url=address)
        self.wait(wait_s)

    def wait(self, seconds: float) -> None:
        """Let the page go on; what it asks for is noted."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.evaluate("1")
            time.sleep(0.1)

    def evaluate(self, expression: str, *, promised: bool = False) -> Any:
        """Value of a JavaScript expression, or of what it promises."""
        answer = self.call(
            "Runtime.evaluate",
            expression=expression,
            returnByValue=True,
            awaitPromise=promised,
        )
        return answer["result"].get("value")

    def png(self, *, whole: bool = False) -> bytes:
        """Take a picture of what is shown, or of the whole page."""
        answer = self.call(
            "Page.captureScreenshot", format="png", captureBeyondViewport=whole
        )
        return base64.b64decode(answer["data"])

    def picture(self) -> np.ndarray:
        """Picture of what is shown, shape (rows, columns, 3), 0 to 255."""
        from matplotlib.image import imread

        return np.round(255 * imread(io.BytesIO(self.png()))[..., :3])

    def click(self, x: float, y: float) -> None:
        """Click at a place in pixels from the upper left."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.call(
                "Input.dispatchMouseEvent", type=kind, x=x, y=y,
                button="none" if kind == "mouseMoved" else "left", clickCount=1,
            )  # fmt: skip
            time.sleep(0.15)


@contextlib.contextmanager
def chromium(folder: Path, *, size: str = "1000,700") -> Iterator[Page]:
    """Start a browser with an empty profile in a folder, and end it again."""
    from websockets.sync.client import connect

    path = find_chromium()
    assert path is not None
    flags = [flag for flag in FLAGS if not flag.startswith("--window-size")]
    command = [path, *flags, f"--window-size={size}", f"--user-data-dir={folder}"]
    process = subprocess.Popen(
        [*command, "about:blank"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        port = _port(folder / "DevToolsActivePort")
        with connect(_tab(port), max_size=None) as socket:
            yield Page(socket)
    finally:
        process.terminate()
        process.wait(timeout=20)


def _port(path: Path) -> int:
    """Port that the browser wrote down when it was ready."""
    for _ in range(300):
        if path.exists() and (lines := path.read_text().splitlines()):
            return int(lines[0])
        time.sleep(0.1)
    raise TimeoutError("Chromium did not start")


def _tab(port: int) -> str:
    """Address of the first tab."""
    import urllib.request

    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
        tabs = json.load(answer)
    return next(tab for tab in tabs if tab["type"] == "page")["webSocketDebuggerUrl"]
