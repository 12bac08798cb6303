"""Who may talk to the page: somebody who was given its address, through a page of its own.

A browser sends requests for any web page that is open in it. A name that suddenly resolves to this machine is refused
by its `Host`, a form of another site by its `Origin`, and anybody else, other users of this machine too, by the token.

The token is the password of HTTP's own scheme, which browsers keep for one port of one name (RFC 7617, 2.2). A cookie
would not do: browsers send it to every port of 127.0.0.1, whichever user of the machine listens there.
"""

from __future__ import annotations

import base64
import binascii
import secrets
from collections.abc import Sequence
from urllib.parse import urlsplit

from starlette.datastructures import MutableHeaders
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
"""Names that only this machine has for itself, as an address holds them."""
MAX_BODY = 2 << 20
"""Bytes of a form."""
OURS_ALONE = "Only a page of `eureka ui` itself may ask for this."
USER = "eureka"
"""The name before the token in the address; any other would do."""
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src data:; media-src 'self'; connect-src 'self'; "
        "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "same-origin",  # with `no-referrer` browsers would hide the origin of our own forms
    "Cross-Origin-Resource-Policy": "same-origin",
}


def middleware(token: str, hosts: Sequence[str]) -> list[Middleware]:
    """What every request passes; `hosts` are the names under which the page may be called, or `*`."""
    return [
        Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts), www_redirect=False),
        Middleware(_Gate, token=token),
    ]


class _Gate:
    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app, self._token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(_HEADERS)
                headers.setdefault("Cache-Control", "no-store")
            await send(message)

        if scope["type"] != "http":  # nothing else is served
            return
        refusal = self._refusal(Request(scope))
        await (refusal or self._app)(scope, receive, guarded)

    def _refusal(self, request: Request) -> Response | None:
        if not self._knows(_password(request.headers.get("authorization", ""))):
            challenge = {"WWW-Authenticate": 'Basic realm="eureka ui: the password is the token", charset="UTF-8"'}
            return PlainTextResponse("Open the address that `eureka ui` printed; it holds the token.", 401, challenge)
        # The browser adds the token to what other sites make it ask for, too. They may send a person here, no more.
        if by_another_site(request) and not _as_a_page(request):
            return PlainTextResponse(OURS_ALONE, 403)
        if request.method not in ("GET", "HEAD"):
            if urlsplit(request.headers.get("origin", "")).netloc != request.headers.get("host"):
                return PlainTextResponse("Only a page of `eureka ui` itself may send this.", 403)
            if not request.headers.get("content-length", "").isdecimal():
                return PlainTextResponse("The length of what is sent must be said.", 411)
            if int(request.headers["content-length"]) > MAX_BODY:
                return PlainTextResponse("This is more than a form may hold.", 413)
        return None

    def _knows(self, said: bytes) -> bool:
        return secrets.compare_digest(said, self._token.encode())


def _password(header: str) -> bytes:
    """That of an `Authorization: Basic`; empty for anything else."""
    scheme, _, code = header.partition(" ")
    if scheme.lower() != "basic":
        return b""
    try:
        return base64.b64decode(code, validate=True).partition(b":")[2]
    except (binascii.Error, ValueError):
        return b""


def by_another_site(request: Request) -> bool:
    """Whether another site's page made the browser ask for this: it links here, embeds or fetches it."""
    return request.headers.get("sec-fetch-site") in ("cross-site", "same-site")


def by_our_page(request: Request) -> bool:
    """Whether a page of this server made the browser ask for this.

    Browsers say so to loopback and over https alone. Elsewhere it is for the `Referer`, which no page can forge, and
    which our own send to us (`Referrer-Policy`).
    """
    site = request.headers.get("sec-fetch-site")
    if site is not None:
        return site == "same-origin"
    return request.headers.get("referer", "").split("/")[2:3] == [request.headers.get("host")]


def _as_a_page(request: Request) -> bool:
    """Whether it is to fill a tab. A frame is navigated too; browsers of before 2020 do not tell the two apart."""
    headers = request.headers
    return headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest", "document") == "document"
