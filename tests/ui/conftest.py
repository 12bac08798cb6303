"""A headless Chromium of the system, and a page that is served to it."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import uvicorn
from playwright.sync_api import Browser, Page, sync_playwright

from openeureka.ui import app, follow, guard, server

from .serving import TOKEN

PATIENCE = 20_000
"""[ms] for what a page is to show; generous, for machines that are busy."""


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        pytest.skip("no Chromium is installed (Debian, Ubuntu: apt-get install chromium)")
    options = ["--no-sandbox"] if os.geteuid() == 0 else []  # Chromium confines itself only as an ordinary user
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=options)
        yield browser
        browser.close()


@pytest.fixture
def address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Where the runs below `tmp_path` are served, followed without long pauses."""
    monkeypatch.setattr(follow, "PAUSE", 0.1)
    monkeypatch.setattr(follow, "SHARE", 1.0)
    with server.listen("127.0.0.1", 0) as listener:
        config = uvicorn.Config(app.build(tmp_path, TOKEN, guard.LOOPBACK), log_level="warning", lifespan="off")
        serving = uvicorn.Server(config)
        thread = threading.Thread(target=serving.run, kwargs={"sockets": [listener]})
        thread.start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        serving.should_exit = serving.force_exit = True
        thread.join()


@pytest.fixture
def page(chromium: Browser, address: str) -> Iterator[Page]:
    """A page that was let in; a script that fails, or a dialog that opens, fails the test."""
    with chromium.new_context(base_url=address) as context:
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        trouble: list[str] = []
        page.on("pageerror", lambda error: trouble.append(str(error)))
        page.on("dialog", lambda dialog: trouble.append(dialog.message))
        page.goto(f"{address.replace('//', f'//{guard.USER}:{TOKEN}@')}/open")
        assert page.url == f"{address}/"
        yield page
        assert not trouble
