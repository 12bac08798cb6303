"""How long a page on a run of 16 x 5 candidates takes to load, and what following it costs.

    python benchmarks/page.py          # needs the extra `dev` and Chromium; about 4 minutes

The run is scripted, its replies, curves and videos are as large as those of a real one: 90 lines of code, 12 curves of
1000 epochs, a film for each candidate. The page is `eureka ui` in a process of its own and a tab of headless Chromium.
It is followed while a reply is committed every 2 s, faster than models write, and then while nothing happens. Seconds
of work are processor time, those of the tab what Chromium calls TaskDuration; a busy machine prolongs the load alone.

A folder of 500 copies of a small run is listed by a server that has just begun, and once more: medians, as of the
loads. The report is that of the first run, without films of candidates, which are files beside it.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
from playwright.sync_api import Browser, CDPSession, Page, Playwright, sync_playwright
from records import command_line, conditions, results, write

from openeureka import strategies
from openeureka.config import RunConfig
from openeureka.events import nobody
from openeureka.film.mp4 import encode
from openeureka.loop import run
from openeureka.report import html
from openeureka.report.view import VIDEO, RunView
from openeureka.store import Store
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyDesk, ToyTrainer
from openeureka.types import LaneSpec, Prompt, Reply, TrainingResult

CONFIG = RunConfig(env="toy", model="scripted", sample=16, iteration=5, refill=0, seeds=3, video="all")
CANDIDATES = CONFIG.sample * CONFIG.iteration
PACED = CANDIDATES - CONFIG.sample
"""Replies from here on, those of the last generation, are followed."""
SMALL = RunConfig(env="toy", model="scripted", sample=2, iteration=2, refill=0, seeds=2)
RUNS = 500
PAUSE = 2.0
"""[s] between two replies."""
REPEATS = 5
"""Loads, of which the median counts."""
SETTLED = 60
"""[s] to wait after the last change: a page that costs much to make is made anew no more often than this."""
EPOCHS, COMPONENTS, LINES = 1000, 8, 90


class Paced(ScriptedModel):
    """Writes the last generation slowly."""

    pause = 0.0

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        for said in super().sample(prompt, n=n, seed=seed):
            if self.said > PACED:
                time.sleep(self.pause)
            yield said


class LongTrainer(ToyTrainer):
    """Leaves curves of real length."""

    def result(self, spec: LaneSpec) -> TrainingResult:
        result = super().result(spec)
        names = [*result.curves, *(f"component/term_{i}" for i in range(COMPONENTS))]
        curves = {
            name: tuple(math.sin(shift + epoch / 50) * math.sqrt(2 + epoch) for epoch in range(EPOCHS))
            for shift, name in enumerate(names)
        }
        return dataclasses.replace(result, curves=curves)


def reply(worth: int) -> str:
    terms = [f"    term_{i} = {i}.5 * torch.exp(-{worth + i} * distance)  # as long as usual" for i in range(LINES)]
    code = "\n".join(["def compute_reward(distance):", *terms, f"    return {worth}.0"])
    return f"{'The last reward made the robot stand still. ' * 20}\n```python\n{code}\n```\n"


def search_slowly(directory: Path, model: Paced) -> None:
    with Store.open(directory, CONFIG) as store:
        run(CONFIG, store, model, ToyChecker(), LongTrainer(), TOY, strategies.make(CONFIG), nobody, ToyDesk())


def film() -> bytes:
    """Six seconds of film, like those of a candidate."""
    row = np.arange(320 * 3).astype(np.uint8).reshape(1, 320, 3)
    return encode((np.repeat(row + np.uint8(frame), 240, axis=0) for frame in range(150)), rate=25)


def show_films(directory: Path, picture: bytes) -> None:
    for lane in (directory / "lanes").glob(f"*-s{CONFIG.seed}"):
        (lane / VIDEO).write_bytes(picture)


def chromium(playwright: Playwright) -> Browser:
    """The Chromium that is installed, headless."""
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    options = ["--no-sandbox"] if os.geteuid() == 0 else []
    return playwright.chromium.launch(executable_path=path, args=options)


@contextmanager
def served(root: Path) -> Iterator[tuple[int, str]]:
    """Process id and address, with the token, of a page."""
    words = [sys.executable, "-P", "-c", "from openeureka.cli.main import main; main()", "ui", str(root), "port=0"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = re.search(r"http\S+", process.stdout.readline())
        assert address is not None
        try:
            yield process.pid, address[0]
        finally:
            process.send_signal(signal.SIGINT)


def load(page: Page, address: str) -> float:
    """[s] until all cards can be seen; the entrance, with the token, is not counted."""
    page.goto(address)
    begun = time.perf_counter()
    page.goto(f"{address.removesuffix('open')}runs/run/")
    assert page.locator("article").count() >= PACED
    page.locator("article").last.wait_for()
    return time.perf_counter() - begun


def server_work(process: int) -> float:
    """[s] of processor time that the page's server has taken so far."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf("SC_CLK_TCK")


def tab_work(tab: CDPSession) -> float:
    """[s] that the tab has worked since its page was opened."""
    metrics = {metric["name"]: metric["value"] for metric in tab.send("Performance.getMetrics")["metrics"]}
    return metrics["TaskDuration"]


def share(process: int, page: Page, seconds: float) -> dict[str, float]:
    """What server and tab take of one core while the page is open."""
    tab = page.context.new_cdp_session(page)
    tab.send("Performance.enable")
    server, browser, begun = server_work(process), tab_work(tab), time.perf_counter()
    page.wait_for_timeout(1000 * seconds)
    took = time.perf_counter() - begun
    return {
        "server": round((server_work(process) - server) / took, 4),
        "tab": round((tab_work(tab) - browser) / took, 4),
    }


def runs(root: Path, count: int) -> None:
    """Copies of a small finished run."""
    first = root / "run-000"
    with Store.open(first, SMALL) as store:
        model, strategy = Paced([reply(n) for n in range(4)]), strategies.make(SMALL)
        run(SMALL, store, model, ToyChecker(), ToyTrainer(), TOY, strategy, nobody, ToyDesk())
    for number in range(1, count):
        shutil.copytree(first, root / f"run-{number:03}")


def listed(browser: Browser, root: Path, count: int) -> dict[str, object]:
    """[s] until all runs of a folder are in the page, and the processor time of the server for that: medians."""

    def seconds(go: Callable[[], object], page: Page) -> float:
        begun = time.perf_counter()
        go()
        page.locator("#runs tbody tr").nth(count - 1).wait_for(state="attached")
        return time.perf_counter() - begun

    first, worked, again, quiet = [], [], [], {}
    for repeat in range(REPEATS):
        with served(root) as (process, address), browser.new_context() as visitor:
            page, before = visitor.new_page(), server_work(process)
            first.append(seconds(partial(page.goto, address), page))
            worked.append(server_work(process) - before)
            again.append(seconds(page.reload, page))
            if repeat == 0:
                quiet = share(process, page, 20)
    return {
        "first": round(statistics.median(first), 2),
        "server_seconds_of_the_first": round(statistics.median(worked), 2),
        "again": round(statistics.median(again), 2),
        "share_of_a_core": quiet,
    }


def measure(folder: Path) -> dict[str, object]:
    directory, picture, model = folder / "run", film(), Paced([reply(n) for n in range(CANDIDATES)])
    model.pause = PAUSE
    searching = threading.Thread(target=search_slowly, args=(directory, model))
    with sync_playwright() as playwright, chromium(playwright) as browser:
        searching.start()
        while model.said < PACED + 1:
            time.sleep(0.1)
        show_films(directory, picture)
        with served(folder) as (process, address):
            page = browser.new_page()
            load(page, address)
            changing = share(process, page, PAUSE * (CONFIG.sample - 2))
            searching.join()
            show_films(directory, picture)
            page.wait_for_timeout(1000 * SETTLED)
            quiet = share(process, page, 20)
            page.close()
        first, again, worked = [], [], []
        for _ in range(REPEATS):
            with served(folder) as (process, address), browser.new_context() as visitor:
                page, before = visitor.new_page(), server_work(process)
                first.append(load(page, address))
                worked.append(server_work(process) - before)
                again.append(load(page, address))
        view = RunView.read(directory)
        begun = time.perf_counter()
        report = html.report(view, directory)
        wrote = time.perf_counter() - begun
        many = folder / "many"
        many.mkdir()
        runs(many, RUNS)
        listing = listed(browser, many, RUNS)
    return {
        "report": {"megabytes": round(len(report.encode()) / 1e6, 2), "seconds": round(wrote, 2)},
        f"list_of_{RUNS}_runs": listing,
        "load_seconds": {"first": round(statistics.median(first), 2), "again": round(statistics.median(again), 2)},
        "server_seconds_of_the_first_load": round(statistics.median(worked), 2),
        "repeats": REPEATS,
        "share_of_a_core": {f"a reply every {PAUSE:g} s": changing, "nothing happens": quiet},
    }


def main() -> None:
    command_line(__doc__).parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = measure(Path(folder))
    found |= {"candidates": CANDIDATES, **conditions()}
    print(json.dumps(found, indent=1))
    write(results("page"), found)


if __name__ == "__main__":
    main()
