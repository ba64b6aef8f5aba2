"""Who is let in to the live view: its own page, and with a token whoever has it."""

from __future__ import annotations

import contextlib
import http.client
from collections.abc import Iterator
from email.message import Message

import pytest

pytest.importorskip("viser")

import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from reachmap.errors import OutputError
from reachmap.view.engine import start_server, stop_server
from reachmap.view.guard import Guard, is_loopback

# The subprotocol that a page of this version of viser asks for.
VISER = [f"viser-v{viser.__version__}"]


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """A live view on this machine alone."""
    server = start_server(0)
    yield server.get_port()
    stop_server(server)


@pytest.fixture(scope="module")
def shared() -> Iterator[tuple[int, str]]:
    """Port and token of a live view on every address of this machine."""
    guard = Guard("0.0.0.0")
    server = start_server(0, host="0.0.0.0", guard=guard)
    yield server.get_port(), guard.token
    stop_server(server)


def page(port: int, path: str = "/", **headers: str) -> tuple[int, str]:
    """Status and cookie of the answer to a request for the page."""
    status, answer = ask(port, path, **headers)
    return status, answer.get("Set-Cookie", "")


def ask(port: int, path: str, **headers: str) -> tuple[int, Message]:
    """Status and headers of the answer to a request."""
    client = http.client.HTTPConnection("127.0.0.1", port, timeout=20)
    with contextlib.closing(client):
        client.putrequest("GET", path, skip_host="Host" in headers)
        for name, value in headers.items():
            client.putheader(name, value)
        client.endheaders()
        with client.getresponse() as answer:
            answer.read()
            return answer.status, answer.headers


def socket_opens(port: int, *, query: str = "", **headers: str) -> bool:
    """Whether a web socket of the view opens and the scene comes."""
    try:
        with connect(
            f"ws://127.0.0.1:{port}/{query}",
            origin=headers.pop("Origin", None),  # type: ignore[arg-type]
            additional_headers=headers,
            subprotocols=VISER,  # type: ignore[arg-type]
            max_size=None,
        ) as socket:
            return len(socket.recv(timeout=20)) > 0
    except InvalidStatus as error:
        if error.response.status_code == 403:
            return False
        raise


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost", "[::1]", "LOCALHOST"])
def test_the_own_page_is_let_in(port: int, name: str) -> None:
    """Under each name of this machine, also when a port is forwarded to it."""
    for host in (f"{name}:{port}", f"{name}:9000"):
        assert page(port, Host=host)[0] == 200
    assert socket_opens(port, Origin=f"http://127.0.0.1:{port}")


@pytest.mark.parametrize(
    "origin",
    [
        "http://evil.example",
        "https://evil.example",
        "null",
        "http://127.0.0.1",
        "http://127.0.0.1:1",
        "http://localhost.evil.example",
        "file://",
    ],
)
def test_pages_of_other_origins_are_turned_away(port: int, origin: str) -> None:
    """Another port of this machine is another origin, too."""
    assert not socket_opens(port, Origin=origin)
    assert page(port, Origin=origin)[0] == 403


@pytest.mark.parametrize(
    "host",
    ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "10.0.0.1", ""],
)
def test_foreign_names_for_this_machine_are_turned_away(port: int, host: str) -> None:
    """So a page cannot get at the view by letting its own name lead here."""
    assert page(port, Host=host)[0] == 403
    assert page(port, Host=host, Origin=f"http://{host}")[0] == 403


def test_no_page_may_show_the_view_inside(port: int) -> None:
    """A page that lay over it could steer it with the clicks of its user."""
    assert ask(port, "/")[1]["X-Frame-Options"] == "DENY"


def test_on_other_addresses_a_token_is_asked_for(shared: tuple[int, str]) -> None:
    """It comes in the address, and then in a cookie that only this page sends."""
    port, token = shared
    assert page(port)[0] == 403
    assert page(port, "/?token=")[0] == 403
    assert page(port, f"/?token={token[:-1]}")[0] == 403
    assert page(port, "/?token=%C3%A9")[0] == 403
    status, cookie = page(port, f"/?token={token}", Host="robot-pc.example:8080")
    assert status == 200
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    crumb = cookie.partition(";")[0]
    assert page(port, Cookie=crumb)[0] == 200
    assert not socket_opens(port)
    own = f"http://127.0.0.1:{port}"
    assert socket_opens(port, Origin=own, Cookie=crumb)
    assert not socket_opens(port, Origin="http://evil.example", Cookie=crumb)
    assert not socket_opens(port, Origin=own, Cookie="reachmap-view=guess")
    assert not socket_opens(port, Origin=own, Cookie='reachmap-view="\\')


def test_every_view_has_a_token_of_its_own() -> None:
    """128 bits at random; none on this machine alone."""
    tokens = {Guard("0.0.0.0").token for _ in range(20)}
    assert len(tokens) == 20
    assert min(map(len, tokens)) >= 22
    assert Guard("127.0.0.1").token == Guard("::1").token == ""


def test_addresses_of_this_machine_alone() -> None:
    """By their numbers, not by how they begin."""
    assert all(map(is_loopback, ("127.0.0.1", "127.8.8.8", "::1", "localhost")))
    others = ("0.0.0.0", "::", "10.0.0.1", "127.0.0.1.evil.example", "", "127.1")
    assert not any(map(is_loopback, others))


def test_an_address_that_is_not_ours_is_refused() -> None:
    """In one line that names the option."""
    with pytest.raises(OutputError, match=r"port 0 cannot be used on 203"):
        start_server(0, host="203.0.113.7")
