"""Somebody who was given the address of a page, and asks for its parts without a browser."""

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
    """Calls the page by an address of this machine, and knows no token."""
    return TestClient(app.build(root, TOKEN, guard.LOOPBACK), base_url="http://127.0.0.1:8080", follow_redirects=False)


def visitor(root: Path) -> TestClient:
    """Has opened the address with the token, and asks from the page itself."""
    client = stranger(root)
    client.auth = (guard.USER, TOKEN)
    client.headers |= {"Origin": "http://127.0.0.1:8080", "Referer": "http://127.0.0.1:8080/"}
    return client


def awaited(work: Coroutine[Any, Any, Value]) -> Value:
    """What a coroutine returns, in a thread of its own: Playwright has a loop in this one."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, work).result()
