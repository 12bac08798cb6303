"""Serves the page until Ctrl-C."""

from __future__ import annotations

import secrets
import socket
from pathlib import Path

import uvicorn

from ..errors import ConfigError
from . import app, guard


def serve(root: Path, host: str, port: int) -> None:
    """Print the address, with its token, and serve.

    Raises:
        ConfigError: when the address cannot be had.
    """
    token = secrets.token_urlsafe(24)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        listener = socket.create_server((host, port), family=family)
    except OSError as error:
        raise ConfigError(f"No page at {host}:{port}: {error.strerror}; choose another host= or port=.") from None
    hosts = guard.LOOPBACK if host in guard.LOOPBACK else ("*",)  # elsewhere it has names that are not known here
    name = f"[{host}]" if ":" in host else host
    print(
        f"Open http://{name}:{listener.getsockname()[1]}/?token={token}\nCtrl-C ends the page; runs go on.", flush=True
    )
    config = uvicorn.Config(app.build(root, token, hosts), log_level="warning", ws="none", lifespan="off")
    uvicorn.Server(config).run(sockets=[listener])
