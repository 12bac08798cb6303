"""Who may talk to the page: somebody who was given its address, through a page of its own.

A browser sends requests for any web page that is open in it. A name that suddenly resolves to this machine is refused
by its `Host`, a form of another site by its `Origin`, and anybody else, other users of this machine too, by the token.
"""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable, Sequence
from urllib.parse import urlsplit

from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
"""Names that only this machine has for itself, as an address holds them."""
MAX_BODY = 2 << 20
"""Bytes of a form."""
_COOKIE = "openeureka"
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; media-src 'self'; connect-src 'self'; "
        "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",  # with `no-referrer` browsers would hide the origin of our own forms
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}

Handler = Callable[[Request], Awaitable[Response]]


def middleware(token: str, hosts: Sequence[str]) -> list[Middleware]:
    """What every request passes; `hosts` are the names under which the page may be called, or `*`."""
    return [
        Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts), www_redirect=False),
        Middleware(BaseHTTPMiddleware, dispatch=_Gate(token)),
    ]


class _Gate:
    def __init__(self, token: str) -> None:
        self._token = token

    async def __call__(self, request: Request, serve: Handler) -> Response:
        response = self._refusal(request) or self._entrance(request) or await serve(request)
        response.headers.update(_HEADERS)
        return response

    def _refusal(self, request: Request) -> Response | None:
        if not (self._knows(request.query_params.get("token")) or self._knows(request.cookies.get(_COOKIE))):
            return PlainTextResponse("Open the address that `eureka ui` printed; it holds the token.", 403)
        if request.method not in ("GET", "HEAD"):
            if urlsplit(request.headers.get("origin", "")).netloc != request.headers.get("host"):
                return PlainTextResponse("Only a page of `eureka ui` itself may send this.", 403)
            if not request.headers.get("content-length", "").isdecimal():
                return PlainTextResponse("The length of what is sent must be said.", 411)
            if int(request.headers["content-length"]) > MAX_BODY:
                return PlainTextResponse("This is more than a form may hold.", 413)
        return None

    def _entrance(self, request: Request) -> Response | None:
        """The token leaves the address, so that no bookmark or screenshot holds it."""
        if "token" not in request.query_params:
            return None
        response = RedirectResponse(request.url.remove_query_params("token"), 303)
        response.set_cookie(_COOKIE, self._token, httponly=True, samesite="lax")
        return response

    def _knows(self, said: str | None) -> bool:
        return said is not None and secrets.compare_digest(said.encode(), self._token.encode())
