"""Somebody who was given the address of a page, and asks for its parts without a browser."""

from __future__ import annotations

from pathlib import Path

from starlette.testclient import TestClient

from openeureka.ui import app, guard

TOKEN = "a-token"


def stranger(root: Path) -> TestClient:
    """Calls the page by an address of this machine, and knows no token."""
    return TestClient(app.build(root, TOKEN, guard.LOOPBACK), base_url="http://127.0.0.1:8080", follow_redirects=False)


def visitor(root: Path) -> TestClient:
    """Has opened the address with the token, and sends forms from the page itself."""
    client = stranger(root)
    client.auth = (guard.USER, TOKEN)
    client.headers["Origin"] = "http://127.0.0.1:8080"
    return client
