"""The system's Chromium, headless, and the page that is served to it."""

from __future__ import annotations

import gzip
import os
import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, sync_playwright
from report.scripted import search_in

from openeureka.testing.scripted import reply
from openeureka.ui import follow, guard, server

from .serving import TOKEN

PATIENCE = 300_000
"""How long a test waits for the page [ms]. Only a page that hangs is to fail: beside three other tests, importing torch
alone can take longer than a person would wait."""


def broken_rules(page: Page) -> list[object]:
    """Accessibility rules that the page breaks as it is shown now, each with the elements (see axe.md)."""
    page.evaluate(gzip.decompress((Path(__file__).parent / "axe.min.js.gz").read_bytes()).decode())
    return page.evaluate("axe.run().then(({violations}) => violations.map(v => [v.id, v.nodes.map(n => n.html)]))")


def comes_true(page: Page, condition: str) -> bool:
    """Whether a condition in JavaScript becomes true in time.

    Playwright's own `wait_for_function` asks again with `eval`, which the page forbids."""
    end = time.monotonic() + PATIENCE / 1000
    while not page.evaluate(condition):
        if time.monotonic() > end:
            return False
        page.wait_for_timeout(50)
    return True


@pytest.fixture(scope="session")
def chromium() -> Iterator[Browser]:
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        pytest.skip("no Chromium is installed (Debian, Ubuntu: apt-get install chromium)")
    options = ["--no-sandbox"] if os.geteuid() == 0 else []  # only an ordinary user's Chromium can confine itself
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=options)
        yield browser
        browser.close()


@contextmanager
def served(root: Path, port: int = 0) -> Iterator[int]:
    """Serves the runs below a folder from a thread, and yields the port."""
    with server.listen("127.0.0.1", port) as listener:
        serving = server.server(root, TOKEN, guard.LOOPBACK)
        thread = threading.Thread(target=serving.run, kwargs={"sockets": [listener]})
        thread.start()
        yield listener.getsockname()[1]
        serving.should_exit = True
        thread.join()


@pytest.fixture
def address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """The address where the runs below `tmp_path` are served. Pages get news without long pauses."""
    monkeypatch.setattr(follow, "PAUSE", 0.1)
    monkeypatch.setattr(follow, "SHARE", 1.0)
    with served(tmp_path) as port:
        yield f"http://127.0.0.1:{port}"


@pytest.fixture
def page(chromium: Browser, address: str) -> Iterator[Page]:
    """A page that has logged in. The test fails if a script fails, the browser reports an error, a dialog opens, or
    anything is requested from elsewhere."""
    with chromium.new_context(base_url=address) as context:
        page = context.new_page()
        page.set_default_timeout(PATIENCE)
        trouble: list[str] = []

        def heard(message: ConsoleMessage) -> None:
            if message.type == "error" and "net::ERR_" not in message.text and "400 (" not in message.text:
                trouble.append(message.text)

        def asked(request: Request) -> None:
            place = urlsplit(request.url)
            if place.scheme not in ("data", "file") and place.netloc.rpartition("@")[2] != urlsplit(address).netloc:
                trouble.append(request.url)

        page.on("console", heard)
        page.on("request", asked)
        page.on("pageerror", lambda error: trouble.append(str(error)))
        page.on("dialog", lambda dialog: trouble.append(dialog.message))
        page.goto(f"{address.replace('//', f'//{guard.USER}:{TOKEN}@')}/open")
        assert page.url == f"{address}/"
        yield page
        assert not trouble


@pytest.fixture(scope="session")
def one_search(tmp_path_factory: pytest.TempPathFactory) -> Path:
    script = [reply(7), "no code", reply(8), reply(3)]
    return search_in(tmp_path_factory.mktemp("searched") / "run", script, iteration=2)


@pytest.fixture
def searched(one_search: Path, tmp_path: Path) -> Path:
    """A finished search of two generations, in which one reward was refused."""
    return shutil.copytree(one_search, tmp_path / "run")
