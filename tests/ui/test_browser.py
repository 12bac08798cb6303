"""The page in headless Chromium, while a scripted run goes on in a thread beside it."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import imageio_ffmpeg
import pytest
from playwright.sync_api import Page, expect
from report.scripted import search_in
from report.test_html import NamesComponents

from openeureka.report.view import VIDEO, RunView
from openeureka.testing.scripted import ScriptedModel, reply
from openeureka.types import Prompt, Reply
from openeureka.ui import launch

from .conftest import PATIENCE

expect.set_options(timeout=PATIENCE)

ATTACK = "</pre><img src=x onerror='window.hacked=1; alert(1)'><script>window.hacked=1</script>\x1b[31m\u202e"


class Paced(ScriptedModel):
    """Gives a reply each time it is allowed one."""

    def __init__(self, script: Sequence[str]) -> None:
        super().__init__(script)
        self.allowed = threading.Semaphore(0)

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        for said in super().sample(prompt, n=n, seed=seed):
            assert self.allowed.acquire(timeout=60)
            yield said


@contextmanager
def running(directory: Path, script: Sequence[str], **settings: object) -> Iterator[Paced]:
    """A search that listens to a person, in a thread that is over soon after the context is left."""
    model = Paced(script)
    settings |= {"model": model, "iteration": 2, "feedback": "human", "feedback_timeout": 3 * PATIENCE / 1000}
    thread = threading.Thread(target=search_in, args=(directory, []), kwargs=settings)
    thread.start()
    try:
        yield model
    finally:
        model.allowed.release(len(script))
        thread.join()


def film(directory: Path, slot: int) -> None:
    """A second of grey as the video of a candidate of generation 0."""
    result = RunView.read(directory).candidates[slot].result
    assert result is not None
    made = directory / "grey.mp4"
    raw = ["-f", "rawvideo", "-pix_fmt", "gray", "-video_size", "64x48", "-framerate", "10", "-i", "-"]
    frames = b"".join(bytes([20 * shade]) * (64 * 48) for shade in range(10))
    # imageio's own writer forks, for which there may be no memory after some thousand tests in this process.
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", *raw, "-pix_fmt", "yuv420p", str(made)]
    subprocess.run(command, input=frames, check=True)
    made.rename(directory / "lanes" / result.lane / VIDEO)


def test_a_person_follows_a_run_and_their_words_are_in_the_next_prompt(page: Page, tmp_path: Path):
    with running(tmp_path / "run", [reply(n) for n in (7, 8, 9, 5)]) as model:
        page.goto("/")
        page.get_by_text("running").click()
        expect(page.locator(".state")).to_have_text("running")
        assert page.locator("article").count() == 0

        model.allowed.release()
        expect(page.locator("#g0s0")).to_contain_text("drawn")  # it appeared without a reload
        model.allowed.release()
        expect(page.locator("#g0s1")).to_contain_text("trained, F 7")
        expect(page.get_by_text("The run waits for a person.")).to_be_visible()

        film(tmp_path / "run", slot=1)
        video = page.locator("#g0s1 video")
        expect(video).to_be_visible()
        video.evaluate("video => video.play()")
        page.wait_for_function("document.querySelector('#g0s1 video').currentTime > 0")

        page.get_by_label("What should be different?").fill("Too jerky: <b>keep</b> the torso upright")
        page.get_by_role("button", name="Say", exact=True).click()
        expect(page.get_by_text("Too jerky: <b>keep</b> the torso upright")).to_be_visible()
        page.get_by_role("button", name="Say, and go on").click()

        model.allowed.release(2)
        expect(page.locator("#g1s1")).to_contain_text("trained, F 4")
        page.get_by_text("What the model was asked").first.click()
        expect(page.locator("details pre", has_text="Too jerky: <b>keep</b> the torso upright")).to_be_visible()

        page.get_by_role("link", name="g1s0").click()
        expect(page.locator(".diff .removed")).to_have_text("-    return 8")
        expect(page.locator(".diff .added")).to_have_text("+    return 9")
    assert "Too jerky: <b>keep</b> the torso upright" in model.prompts[-1].messages[-1].content


def test_two_candidates_are_compared_and_the_better_one_gets_the_vote(page: Page, tmp_path: Path):
    with running(tmp_path / "run", [reply(n) for n in (7, 8, 9, 5)]) as model:
        model.allowed.release(2)
        page.goto("/runs/run/")
        expect(page.get_by_text("The run waits for a person.")).to_be_visible()
        for name in ("g0s0", "g0s1"):
            page.locator(f"#{name}").get_by_label("compare").check()
        page.get_by_role("button", name="Compare the chosen side by side").click()
        expect(page.locator("section.candidate")).to_have_count(2)
        page.get_by_role("button", name="Better than g0s1").click()
        expect(page.get_by_text("g0s0 is better than g0s1")).to_be_visible()
        page.get_by_role("button", name="Say, and go on").click()
        expect(page.get_by_text("Generation 1")).to_be_visible()


def test_what_a_person_types_opens_and_chooses_survives_the_news(page: Page, tmp_path: Path):
    with running(tmp_path / "run", [reply(n) for n in (7, 8, 9, 5)]) as model:
        model.allowed.release()
        page.goto("/runs/run/")
        page.get_by_label("What should be different?").fill("half a sen")
        page.get_by_text("What the model was asked").click()
        page.locator("#g0s0").get_by_label("compare").check()
        model.allowed.release()
        expect(page.locator("#g0s0")).to_contain_text("trained, F 6")  # its card was renewed
        expect(page.get_by_label("What should be different?")).to_have_value("half a sen")
        expect(page.locator("pre", has_text="Do the thing.")).to_be_visible()
        expect(page.locator("#g0s0").get_by_label("compare")).to_be_checked()
        page.get_by_role("button", name="Say, and go on").click()


def test_nothing_that_others_wrote_runs(page: Page, tmp_path: Path):
    text = f"{ATTACK}\n```python\ndef compute_reward(x):\n    # {ATTACK}\n    return 7\n```"
    with running(
        tmp_path / "<img src=x onerror=alert(1)>", [text, ATTACK, reply(1), reply(2)], trainer=NamesComponents()
    ) as model:
        model.allowed.release(2)
        page.get_by_text("<img src=x onerror=alert(1)>", exact=True).click()
        page.get_by_label("What should be different?").fill(ATTACK)
        expect(page.get_by_text("The run waits for a person.")).to_be_visible()
        page.get_by_role("button", name="Say", exact=True).click()
        expect(page.locator(".listens")).to_contain_text("<script>window.hacked=1</script>")  # came with the page
        page.get_by_role("button", name="Say, and go on").click()
        model.allowed.release(2)
        expect(page.locator("#g1s1")).to_contain_text("trained, F 1")  # came by following
        page.get_by_role("link", name="g0s0").click()
        expect(page.get_by_text("Reward code")).to_be_visible()
        assert page.evaluate("window.hacked") is None
        assert page.locator("img").count() == 0 and page.locator("script").count() == 1


def test_a_page_that_has_lost_its_server_says_so_until_it_is_back(page: Page, tmp_path: Path):
    search_in(tmp_path / "run", [reply(7), reply(8)])
    page.goto("/runs/run/")
    page.context.set_offline(True)
    expect(page.get_by_text("This page no longer hears from eureka ui.")).to_be_visible()
    page.context.set_offline(False)
    expect(page.get_by_text("This page no longer hears from eureka ui.")).to_be_hidden()


def test_a_run_is_started_from_the_form(page: Page, monkeypatch: pytest.MonkeyPatch):
    # A run needs seconds to import torch; what is tested is the form.
    monkeypatch.setattr(launch, "_EUREKA", [sys.executable, "-c", "import sys; print(*sys.argv[1:])"])
    page.get_by_text("Start a run").click()
    page.get_by_label("task").fill("quadcopter")
    page.get_by_label("rewards per generation").fill("0")
    page.get_by_role("button", name="Start").click()
    assert page.url.endswith("/")  # the browser itself refuses none
    page.get_by_label("rewards per generation").fill("3")
    page.get_by_role("button", name="Start").click()
    expect(page.locator("pre")).to_contain_text(
        "run env=quadcopter model=local sample=3 seed=0 device=cpu feedback=none"
    )
