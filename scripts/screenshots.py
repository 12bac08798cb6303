"""Renews docs/images: the page and the report of a small search, as headless Chromium shows them.

python scripts/screenshots.py [RUN]     # without a run it makes one; needs the extra `dev` and Chromium
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Page, ViewportSize, sync_playwright

from openeureka.report.view import RunView

IMAGES = Path(__file__).parents[1] / "docs" / "images"
EUREKA = [sys.executable, "-P", "-c", "from openeureka.cli.main import main; main()"]
SEARCH = ["env=cartpole", "model=random", "sample=6", "iteration=2", "steps=150000", "seeds=1", "video=all"]
SIZE = ViewportSize(width=1100, height=1200)


@contextmanager
def served(root: Path) -> Iterator[str]:
    """The address of a page, with its token."""
    with subprocess.Popen([*EUREKA, "ui", str(root), "port=0"], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = re.search(r"http\S+", process.stdout.readline())
        assert address is not None
        try:
            yield address[0]
        finally:
            process.send_signal(signal.SIGINT)


def take(page: Page, run: Path) -> None:
    best = RunView.read(run).best
    assert best is not None
    chosen = [best, *(c for c in RunView.read(run).candidates if c.parent is not None and c.result is not None)]
    shown = "&".join(f"show={candidate.place}" for candidate in chosen[:2])
    with served(run.parent) as address:
        page.goto(address)
        _shoot(page, "runs")
        page.goto(f"{address.removesuffix('open')}runs/{run.name}/")
        _shoot(page, "run")
        page.goto(f"{address.removesuffix('open')}runs/{run.name}/candidates?{shown}")
        _shoot(page, "candidates")
    page.goto((run / "report.html").resolve().as_uri())
    _shoot(page, "report")


def _shoot(page: Page, name: str) -> None:
    page.wait_for_load_state("networkidle")  # films show their first picture
    page.screenshot(path=IMAGES / f"{name}.png")


def main() -> None:
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    options = ["--no-sandbox"] if os.geteuid() == 0 else []
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        run = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(folder) / "cartpole"
        if not run.exists():
            subprocess.run([*EUREKA, "run", *SEARCH, f"dir={run}"], check=True)
        with playwright.chromium.launch(executable_path=path, args=options) as browser:
            take(browser.new_page(viewport=SIZE), run)


if __name__ == "__main__":
    main()
