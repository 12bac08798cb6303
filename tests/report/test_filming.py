from threading import Event

import pytest

from openeureka.config import RunConfig
from openeureka.film import video
from openeureka.report import build, filming
from openeureka.report.filming import Filming
from openeureka.report.view import RunView
from openeureka.testing.scripted import ScriptedModel, program, reply
from openeureka.types import Candidate

from .scripted import search_in

CONFIG = RunConfig(env="toy", sample=2, iteration=1, seeds=1, video="all")
SEVEN, EIGHT = (Candidate.of(program(n)).id for n in (7, 8))


@pytest.fixture
def camera(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The policies that would have been filmed. A toy policy is its worth as text."""
    filmed: list[str] = []

    def render(env: str, policy: bytes, **_: object) -> bytes:
        filmed.append(policy.decode())
        return b"mp4 of " + policy

    monkeypatch.setattr(video, "render", render)
    return filmed


def test_every_lane_of_the_search_is_filmed_and_no_final_one(camera, tmp_path):
    with Filming(tmp_path, CONFIG) as films:
        search_in(tmp_path, [reply(7), reply(8)], tell=films)
    made = {path.parent.name for path in tmp_path.glob("lanes/*/video.mp4")}
    assert made == {f"{SEVEN}-s0", f"{EIGHT}-s0", "human-s0", "sparse-s0"}
    assert (tmp_path / f"lanes/{SEVEN}-s0/video.mp4").read_bytes() == b"mp4 of 7.0"


def test_the_search_goes_on_while_a_film_takes_its_time(monkeypatch, tmp_path):
    developed = Event()
    monkeypatch.setattr(video, "render", lambda *_, **__: developed.wait() and b"mp4")
    with Filming(tmp_path, CONFIG) as films:
        search_in(tmp_path, [reply(7), reply(8)], tell=films)
        assert RunView.read(tmp_path).outcome is not None  # the search is finished, and no film is
        assert not list(tmp_path.glob("lanes/*/video.mp4"))
        developed.set()
    assert len(list(tmp_path.glob("lanes/*/video.mp4"))) == 4


def test_only_what_is_missing_is_filmed_again(camera, tmp_path):
    search_in(tmp_path, [reply(7), reply(8)])
    (tmp_path / "lanes/human-s0/video.mp4").write_bytes(b"old")
    build.build(tmp_path, "all", "toy")
    assert sorted(camera) == ["5.0", "7.0", "8.0"]  # the sparse reward is worth 5
    build.build(tmp_path, "all", "toy")
    assert len(camera) == 3


def test_a_stopped_search_leaves_at_once_and_resuming_films_the_rest(camera, monkeypatch, tmp_path):
    class Stopping(ScriptedModel):
        def sample(self, prompt, *, n, seed):
            if self.said == 2:
                raise KeyboardInterrupt
            yield from super().sample(prompt, n=n, seed=seed)

    stuck = Event()
    with monkeypatch.context() as patch:
        patch.setattr(video, "render", lambda *_, **__: stuck.wait() and b"late")
        with pytest.raises(KeyboardInterrupt), Filming(tmp_path, CONFIG) as films:
            model = Stopping([reply(7), reply(8)])
            search_in(tmp_path, [], model=model, iteration=2, tell=films)
    with Filming(tmp_path, CONFIG) as films:
        search_in(tmp_path, [reply(9), reply(6)], iteration=2, tell=films)
    stuck.set()
    assert {"7.0", "8.0", "9.0", "6.0"} <= set(camera)


def test_a_machine_that_cannot_render_is_asked_once_and_says_so_in_one_sentence(monkeypatch, tmp_path):
    asked = []

    def render(*_: object, **__: object) -> bytes:
        asked.append(1)
        raise video.NoRenderer("No video: install one.")

    monkeypatch.setattr(video, "render", render)
    search_in(tmp_path, [reply(7), reply(8)])
    assert filming.film(tmp_path, "toy", filming.missing(tmp_path).items()) == "No video: install one."
    assert len(asked) == 1


def test_a_policy_that_cannot_be_shown_costs_its_own_video_only(monkeypatch, tmp_path):
    def render(env: str, policy: bytes, **_: object) -> bytes:
        if policy == b"7.0":
            raise video.VideoUnavailable("It is broken.")
        return b"mp4"

    monkeypatch.setattr(video, "render", render)
    search_in(tmp_path, [reply(7), reply(8)])
    problem = filming.film(tmp_path, "toy", filming.missing(tmp_path).items())
    assert problem == f"No video of {SEVEN}-s0: It is broken."
    assert len(list(tmp_path.glob("lanes/*/video.mp4"))) == 3
