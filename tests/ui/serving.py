"""Clients that ask for the page without a browser."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

from starlette.testclient import TestClient

from openeureka.ui import app, guard

TOKEN = "a-token"
Value = TypeVar("Value")


def stranger(root: Path) -> TestClient:
    """A client that reaches the page on this machine, but has no token."""
    return TestClient(app.build(root, TOKEN, guard.LOOPBACK), base_url="http://127.0.0.1:8080", follow_redirects=False)


def visitor(root: Path) -> TestClient:
    """A client that has the token, and sends its requests as the page itself does."""
    client = stranger(root)
    client.auth = (guard.USER, TOKEN)
    client.headers |= {"Origin": "http://127.0.0.1:8080", "Referer": "http://127.0.0.1:8080/"}
    return client


def awaited(work: Coroutine[Any, Any, Value]) -> Value:
    """The result of a coroutine. It runs in another thread, because Playwright has an event loop in this one."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, work).result()
