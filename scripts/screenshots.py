"""Renews docs/images: the page and the report of a small search, as headless Chromium shows them.

    python scripts/screenshots.py [RUN]               # without a run it makes one; needs the extra `dev` and Chromium
    python scripts/screenshots.py RUN --all FOLDER    # every page, light and dark, 400 and 1400 px wide, to look at

With --all the folder that holds the run is what the list and the comparison show.
"""

from __future__ import annotations

import argparse
import lzma
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from contextlib import chdir
from itertools import product
from pathlib import Path
from typing import Literal

from playwright.sync_api import Page, ViewportSize, sync_playwright

from openeureka.report.view import RunView
from openeureka.store import is_run
from openeureka.store.db import FILENAME

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from page import chromium, served

IMAGES = Path(__file__).parents[1] / "docs" / "images"
REPLIES = IMAGES.parents[1] / "benchmarks" / "choosing" / "ballbalance.json"
ARCHIVE = IMAGES.parents[1] / "benchmarks" / "headline"
EUREKA = [sys.executable, "-P", "-c", "from openeureka.cli.main import main; main()"]
SEARCH = [
    "env=ballbalance",
    f"model=replay:{REPLIES}",
    "sample=4",
    "iteration=2",
    "steps=300000",
    "seeds=3",
    "video=all",
]
ROWS = ("ant", "cartpole", "franka_cabinet", "humanoid", "quadcopter", "shadow_hand_over", "shadow_hand_switch")
"""Rows of the table whose runs the list shows, besides the run that is made."""
SHOWN = {"runs": 560, "run": 1400, "candidates": 1400, "report": 1400}
"""What the docs show, and how much of it [pixels]."""
SCHEMES: tuple[Literal["light", "dark"], ...] = ("light", "dark")


def unpack(rows: Iterable[str], folder: Path) -> None:
    """Archived runs of the table, without their policies."""
    for name in rows:
        (folder / name).mkdir()
        (folder / name / FILENAME).write_bytes(lzma.decompress((ARCHIVE / f"{name}.sqlite.xz").read_bytes()))


def addresses(run: Path, page: str) -> dict[str, str]:
    """The address of every page, by name; `page` is where `eureka ui` serves."""
    view = RunView.read(run)
    assert view.best is not None
    chosen = [view.best, *(c for c in view.candidates if c.parent is not None and c.result is not None)]
    refused = next((c for c in view.candidates if c.result is None), view.best)
    runs = [path.name for path in sorted(run.parent.iterdir()) if is_run(path)][:4]
    at = f"{page}runs/{run.name}/"
    return {
        "runs": page,
        "run": at,
        "candidate": f"{at}candidates?show={chosen[-1].place}",
        "candidates": f"{at}candidates?" + "&".join(f"show={one.place}" for one in chosen[:2]),
        "refused": f"{at}candidates?show={refused.place}",
        "compare": f"{page}compare?" + "&".join(f"run={name}" for name in runs),
        "report": (run / "report.html").resolve().as_uri(),
    }


def shoot(page: Page, address: str, file: Path, *, whole: bool) -> None:
    page.goto(address)
    for _ in range(20):  # some things are drawn or loaded only when they come into view
        page.mouse.wheel(0, 1000)
        page.wait_for_timeout(50)
    page.evaluate("scrollTo(0, 0)")
    page.wait_for_timeout(500)
    page.screenshot(path=file, full_page=whole)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, nargs="?")
    parser.add_argument("--all", type=Path)
    options = parser.parse_args()
    options.run, options.all = (path and path.resolve() for path in (options.run, options.all))
    # The page shows the run's path, from here: outputs/ballbalance, as for somebody who searches in a folder of theirs.
    with tempfile.TemporaryDirectory() as folder, chdir(folder), sync_playwright() as playwright:
        run = options.run or Path("outputs/ballbalance")
        if not run.exists():
            run.parent.mkdir(parents=True, exist_ok=True)
            unpack(ROWS, run.parent)
            subprocess.run([*EUREKA, "run", *SEARCH, f"dir={run}"], check=True)
        with chromium(playwright) as browser, served(run.parent) as (_, entrance):
            page = browser.new_page()
            page.goto(entrance)
            found = addresses(run, re.sub(r"//\S+@", "//", entrance.removesuffix("open")))
            if options.all is None:
                for name, height in SHOWN.items():
                    page.set_viewport_size(ViewportSize(width=1280, height=height))
                    shoot(page, found[name], IMAGES / f"{name}.png", whole=False)
                return
            options.all.mkdir(parents=True, exist_ok=True)
            for width, scheme in product((1400, 400), SCHEMES):
                page.set_viewport_size(ViewportSize(width=width, height=900))
                page.emulate_media(color_scheme=scheme)
                for name, address in found.items():
                    shoot(page, address, options.all / f"{name}-{scheme}-{width}.png", whole=True)


if __name__ == "__main__":
    main()
