"""Who may send requests to the page: somebody who was given its address, and only through the page itself.

A browser sends requests for any web page that is open in it. A foreign name that is made to resolve to this machine
(DNS rebinding) is refused by its `Host`, a form of another site by its `Origin`, and anybody else, also another user of
this machine, by the token.

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
"""Names of loopback, as they stand in an address."""
MAX_BODY = 2 << 20
"""Most bytes of a form."""
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
    """What every request passes; `hosts` are the names by which the page may be called, or `*`."""
    return [
        Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts), www_redirect=False),
        Middleware(_Gate, token=token),
    ]


class _Gate:
    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app, self._token = app, token.encode()

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
        said = _password(request.headers.get("authorization", ""))
        if not secrets.compare_digest(said, self._token):
            challenge = {"WWW-Authenticate": 'Basic realm="eureka ui: the password is the token", charset="UTF-8"'}
            return PlainTextResponse("Open the address that `eureka ui` printed; it holds the token.", 401, challenge)
        # The browser adds the token also to requests that other sites cause. They may link here, and nothing else.
        if by_another_site(request) and not _as_a_page(request):
            return PlainTextResponse(OURS_ALONE, 403)
        if request.method not in ("GET", "HEAD"):
            if urlsplit(request.headers.get("origin", "")).netloc != request.headers.get("host"):
                return PlainTextResponse("Only a page of `eureka ui` itself may send this.", 403)
            if not request.headers.get("content-length", "").isdecimal():
                return PlainTextResponse("The request must state its content length.", 411)
            if int(request.headers["content-length"]) > MAX_BODY:
                return PlainTextResponse("This form is too large.", 413)
        return None


def _password(header: str) -> bytes:
    """The password in an `Authorization: Basic` header; empty for anything else."""
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

    Browsers send `Sec-Fetch-Site` only to loopback and over https. Elsewhere the `Referer` decides: no page can forge
    it, and our own pages send it to us (`Referrer-Policy`).
    """
    site = request.headers.get("sec-fetch-site")
    if site is not None:
        return site == "same-origin"
    return request.headers.get("referer", "").split("/")[2:3] == [request.headers.get("host")]


def _as_a_page(request: Request) -> bool:
    """Whether the answer fills a tab. A frame is navigated to as well; browsers before 2020 do not distinguish them."""
    headers = request.headers
    return headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest", "document") == "document"
