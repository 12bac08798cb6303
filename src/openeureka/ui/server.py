"""Serves the page until Ctrl-C."""

from __future__ import annotations

import secrets
import socket
from collections.abc import Sequence
from pathlib import Path

import uvicorn

from ..errors import ConfigError
from . import app, guard

LONGEST_ADDRESS = 1 << 20
"""Most bytes of a request's head: an open page says which parts it shows, 13 bytes for each candidate of a run."""

_ALL = ("0.0.0.0", "::")


def serve(root: Path, host: str, port: int) -> None:
    """Print the address, with its token, and serve. Raises ConfigError when the address cannot be used."""
    token = secrets.token_urlsafe(24)
    with listen(host, port) as listener:
        print(f"Open http://{guard.USER}:{token}@{called(host)}:{listener.getsockname()[1]}{app.ENTRANCE}")
        print("Press Ctrl-C to close the page; runs continue.", flush=True)
        serving = server(root, token, names(host))
        try:
            serving.run(sockets=[listener])
        except KeyboardInterrupt:
            pass  # the usual way to end the page


def server(root: Path, token: str, hosts: Sequence[str]) -> uvicorn.Server:
    """A server whose streams to open pages end when it does."""

    def ending() -> bool:
        return found.should_exit

    page = app.build(root, token, hosts, ending)
    found = uvicorn.Server(
        uvicorn.Config(
            page,
            log_level="warning",
            ws="none",
            lifespan="off",
            timeout_graceful_shutdown=2,
            h11_max_incomplete_event_size=LONGEST_ADDRESS,
        )
    )
    return found


def listen(host: str, port: int) -> socket.socket:
    """A socket for connections; port 0 takes a free one. Raises ConfigError when the address cannot be used."""
    try:
        return socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except OSError as error:
        raise ConfigError(
            f"Cannot serve the page at {host}:{port}: {error.strerror}; choose another host= or port=, where 0 takes a "
            "free one."
        ) from None


def names(host: str) -> tuple[str, ...]:
    """Names by which the page may be called: those of loopback, or any name where other machines can connect."""
    return guard.LOOPBACK if _in_address(host) in guard.LOOPBACK else ("*",)


def called(host: str) -> str:
    """The host in the address for a browser. Where `host` means all interfaces, it is the address by which other
    machines reach this one, or its name where it has no network."""
    if host not in _ALL:
        return _in_address(host)
    family, beyond = (socket.AF_INET6, "2001:db8::1") if ":" in host else (socket.AF_INET, "192.0.2.1")
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.connect((beyond, 9))  # a datagram socket only chooses a route here, and sends nothing
            return _in_address(probe.getsockname()[0])
    except OSError:
        return socket.gethostname()


def _in_address(host: str) -> str:
    return f"[{host}]" if ":" in host else host
