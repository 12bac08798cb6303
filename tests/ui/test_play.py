"""Playing with policies: pushing and changing the robot, who may do so, and all of it in a browser."""

from __future__ import annotations

import asyncio
import io
import shutil
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import torch
from PIL import Image
from playwright.sync_api import Page, expect
from report.policies import policy
from report.scripted import search_in

from openeureka.film.live import Live
from openeureka.report import filming
from openeureka.report.view import RunView
from openeureka.tasks import registry
from openeureka.testing.scripted import reply
from openeureka.training.policy import Policy
from openeureka.ui import play

from .conftest import PATIENCE, broken_rules, comes_true
from .serving import awaited, stranger, visitor


def of(env: str) -> bytes:
    task = registry.get(env)
    return Policy(env, policy(task.num_observations, task.num_actions, (8,)).tensors).to_bytes()


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A toy search that is recorded as one for cartpole. Its policies are untrained."""
    monkeypatch.setattr(filming, "policies", lambda store, lanes: dict.fromkeys(lanes, of("cartpole")))
    return search_in(tmp_path / "run", [reply(7), reply(8)], env="cartpole")


def test_a_push_moves_what_is_heaviest_that_way():
    stage = Live("ant", of("ant"))
    stage.camera.azimuth = 0.0
    stage.push(2.0, 0.0)
    assert 1.0 < stage._velocity[0, 0] < 3.0  # the legs lag behind the torso
    assert abs(float(stage._velocity[0, 1])) < 0.3


def test_mass_and_friction_are_multiples_of_the_tasks_own():
    stage = Live("ant", of("ant"))
    sim = stage._simulation.sim
    for factor in (2.0, 0.5):
        stage.scale(factor, 3.0 * factor)
        assert torch.allclose(sim.expand("body_mass")[0], factor * torch.as_tensor(sim.model.body_mass).float())
        own = torch.as_tensor(sim.model.geom_friction).float()
        assert torch.allclose(sim.expand("geom_friction")[0, :, 0], 3.0 * factor * own[:, 0])


def test_a_world_begins_anew():
    stage = Live("cartpole", of("cartpole"))
    for _ in range(5):
        stage.step()
    assert stage._simulation.task.progress[0] == 5
    stage.restart()
    assert stage._simulation.task.progress[0] == 0


def test_only_who_has_the_token_plays_and_only_with_numbers_in_bounds(run: Path):
    address = "/runs/run/play/g0s0"
    assert stranger(run.parent).get(address).status_code == 401
    assert stranger(run.parent).post(address, data={"do": "restart"}).status_code == 401
    client = visitor(run.parent)
    assert client.get("/runs/run/play/g7s7").status_code == 404
    assert client.post(address, data={"do": "restart"}).status_code == 409  # no policy is played
    assert client.post(address, data={"do": "restart"}, headers={"Origin": "http://evil"}).status_code == 403
    for form in ({"do": "run"}, {"do": "push", "speed": "1e9", "angle": "0"}, {"do": "scale", "mass": "nan"}):
        assert client.post(address, data=form).status_code == 400


NAVIGATED = {"Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Sec-Fetch-Site": "same-origin"}, 200),
        ({"Sec-Fetch-Site": "cross-site", **NAVIGATED}, 403),
        ({"Sec-Fetch-Site": "same-site", **NAVIGATED}, 403),
        # Browsers send no Sec-Fetch headers to an address of the network.
        ({"Referer": "http://127.0.0.1:8080/runs/run/candidates"}, 200),
        ({"Referer": "http://evil.example/http://127.0.0.1:8080/"}, 403),
        ({"Referer": "http://127.0.0.1:8081/"}, 403),
        ({"Referer": "http://["}, 403),
        ({"Referer": ""}, 403),
    ],
)
def test_the_page_itself_makes_a_policy_play_and_no_link_of_another_site(
    run: Path, monkeypatch: pytest.MonkeyPatch, headers: dict[str, str], status: int
):
    async def nothing(self: play.Players, *_: object) -> AsyncIterator[str]:
        yield ""

    monkeypatch.setattr(play.Players, "events", nothing)
    assert visitor(run.parent).get("/runs/run/play/g0s0", headers=headers).status_code == status


def test_a_task_that_is_not_installed_is_never_imported_to_be_played(tmp_path: Path):
    search_in(tmp_path / "run", [reply(7), reply(8)], env="python:evil.py:Env")
    page = visitor(tmp_path).get("/runs/run/candidates?show=g0s0")
    assert page.status_code == 200 and "data-play" not in page.text
    assert visitor(tmp_path).get("/runs/run/play/g0s0").status_code == 404


def test_candidates_of_a_task_whose_package_is_missing_here_are_shown(tmp_path: Path):
    search_in(tmp_path / "run", [reply(7), reply(8)], env="gym:TheirPackage-v0")
    page = visitor(tmp_path).get("/runs/run/candidates?show=g0s0")
    assert page.status_code == 200 and 'id="g0s0"' in page.text and "data-play" not in page.text
    assert visitor(tmp_path).get("/runs/run/play/g0s0").status_code == 404


def test_where_no_policy_is_there_is_no_start(tmp_path: Path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)], env="cartpole")
    address = "/runs/run/candidates?show=g0s0&show=g0s1"
    assert visitor(tmp_path).get(address).text.count("data-play") == 2
    lane = next(path for path in (directory / "lanes").iterdir() if path.name.startswith(place(directory, "g0s0")))
    shutil.rmtree(lane)  # as in a copy of the store alone
    shown = visitor(tmp_path).get(address).text
    assert shown.count("data-play") == 1 and 'data-play="play/g0s1"' in shown


def place(directory: Path, name: str) -> str:
    program = next(c.program for c in RunView.read(directory).candidates if str(c.place) == name)
    assert program is not None
    return program.id


def test_who_must_leave_is_told_that_another_one_began():
    players, policy = play.Players(), of("cartpole")

    async def never() -> bool:
        return False

    async def first_word() -> str:
        async for event in players.events("run/g0s0", "cartpole", policy, never):
            return event
        return ""

    async def both() -> str:
        first = asyncio.create_task(first_word())
        while not players._playing:
            await asyncio.sleep(0.01)
        second = asyncio.create_task(first_word())
        said = await first
        second.cancel()
        return said

    assert awaited(both()) == 'event: end\ndata: "The policy has stopped. Another one was started."\n\n'


def test_a_policy_that_went_since_the_page_was_opened_is_not_said_to_have_played(page: Page, run: Path):
    page.goto("/runs/run/candidates?show=g0s0")
    page.route("**/play/g0s0", lambda route: route.abort())
    page.get_by_role("button", name="Start").click()
    expect(page.get_by_text("It could not start")).to_be_visible()


def test_a_person_plays_with_a_policy_in_3d(page: Page, run: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(play, "PATIENCE", 3 * PATIENCE / 1000)
    page.goto("/runs/run/candidates?show=g0s0")
    page.set_default_timeout(3 * PATIENCE)  # the child loads torch and MuJoCo
    page.get_by_role("button", name="Start").click()
    canvas = page.locator(".play canvas")
    expect(canvas).to_be_visible(timeout=3 * PATIENCE)
    assert comes_true(page, "document.querySelector('[data-play]').dataset.frames > 3")
    seen = Image.open(io.BytesIO(canvas.screenshot())).convert("RGB").resize((32, 18))
    assert len(set(seen.tobytes())) > 20
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme, reduced_motion="reduce")  # no colour is half-way between two
        assert not (broken := broken_rules(page)), (scheme, broken)
    page.set_viewport_size({"width": 400, "height": 900})
    assert comes_true(page, "document.documentElement.scrollWidth <= 400")  # charts follow a frame later
    with page.expect_response("**/play/g0s0") as pushed:
        page.get_by_role("button", name="Push left").click()
    assert pushed.value.status == 204
    with page.expect_response("**/play/g0s0") as scaled:
        page.get_by_role("slider", name="Mass, times").fill("2")
    assert scaled.value.status == 204
    with page.expect_response("**/play/g0s0") as renewed:
        page.get_by_role("button", name="Restart").click()
    assert renewed.value.status == 204
    page.get_by_role("button", name="Stop").click()
    expect(canvas).to_be_hidden()
