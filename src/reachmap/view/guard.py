"""Access control of the live view: its own page, and holders of its token.

A server on this machine can be reached by every web page that is open in a browser
here. Browsers say which page asks (``Origin``) and which name it asked for (``Host``);
pages of other origins, and foreign names that lead here, are turned away.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from reachmap.errors import EngineError

if TYPE_CHECKING:
    from websockets.http11 import Request, Response

COOKIE = "reachmap-view"


class Guard:
    """Accepts or refuses requests to the live view.

    Parameters
    ----------
    host : str
        Address the view listens on. On a loopback address only pages under a name of
        this machine may connect; on any other, those who know the token.

    Attributes
    ----------
    token : str
        Part of the address of the view, "" where none is needed.
    """

    def __init__(self, host: str) -> None:
        self.token = "" if is_loopback(host) else secrets.token_urlsafe(16)
        self.is_posted = False

    def reason_against(self, request: Request) -> str:
        """Reason to refuse a request, "" if it may be answered."""
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1:
            return "expected one Host"
        host = hosts[0].lower()
        if not self.token and not is_loopback(urlsplit(f"//{host}").hostname or ""):
            return "not a name of this machine"
        own = (f"http://{host}", f"https://{host}")
        if any(page.lower() not in own for page in request.headers.get_all("Origin")):
            return "requests from other pages are refused"
        if self.token and not (self._in_address(request) or self._in_cookie(request)):
            return "expected the address that reachmap printed, with its token"
        return ""

    def _in_address(self, request: Request) -> bool:
        given = parse_qs(urlsplit(request.path).query).get("token", [""])[0]
        return self._fits(given)

    def _in_cookie(self, request: Request) -> bool:
        for header in request.headers.get_all("Cookie"):
            try:
                cookie = SimpleCookie(header).get(COOKIE)
            except CookieError:
                continue
            if cookie is not None and self._fits(cookie.value):
                return True
        return False

    def _fits(self, given: str) -> bool:
        return hmac.compare_digest(given.encode(errors="replace"), self.token.encode())

    def finish(self, response: Response) -> None:
        """Store the token in a cookie, and forbid embedding in other pages."""
        response.headers["X-Frame-Options"] = "DENY"
        if self.token:
            response.headers["Set-Cookie"] = (
                f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
            )


def is_loopback(host: str) -> bool:
    """Whether a name or address is a loopback one."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


@contextmanager
def posted(guard: Guard) -> Iterator[None]:
    """Put a guard before the server that is started in the ``with`` block.

    The viewer has no place for one, so that it is put where the viewer gives the
    library of web sockets its own answers.

    Raises
    ------
    EngineError
        The viewer has come to start its server in another way.
    """
    from websockets.asyncio import server

    original: Any = server.serve

    def serve(*arguments: Any, **how: Any) -> Any:
        guard.is_posted = True
        how["process_request"] = _guarded(guard, how.get("process_request"))
        return original(*arguments, **how)

    server.serve = serve  # type: ignore[assignment, misc, unused-ignore]
    try:
        yield
    finally:
        server.serve = original  # type: ignore[misc, unused-ignore]
    if not guard.is_posted:
        raise EngineError("this version of viser cannot be kept from foreign pages")


def _guarded(
    guard: Guard, answer: Callable[[Any, Request], Response | None] | None
) -> Callable[[Any, Request], Response | None]:
    def process(connection: Any, request: Request) -> Response | None:
        if reason := guard.reason_against(request):
            refusal: Response = connection.respond(HTTPStatus.FORBIDDEN, f"{reason}\n")
            return refusal
        response = None if answer is None else answer(connection, request)
        if response is not None:
            guard.finish(response)
        return response

    return process
