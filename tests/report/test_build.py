import pytest

from openeureka.film import video
from openeureka.report import build
from openeureka.testing.scripted import reply

from .policies import policy
from .scripted import search_in


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A finished toy run with a real network as its best policy; rendering is faked."""
    filmed = []

    def render(env: str, *_: object, **__: object) -> bytes:
        filmed.append(env)
        return b"mp4"

    monkeypatch.setattr(video, "render", render)
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    (directory / "best" / "policy.safetensors").write_bytes(policy(4, 1, (8,)).to_bytes())
    return directory, filmed


def test_everything_a_person_opens_is_made(run):
    directory, _ = run
    assert build.build(directory, env="cartpole") == []
    made = {path.relative_to(directory).as_posix() for path in directory.rglob("*")}
    assert {"report.html", "best/policy.onnx", "best/video.mp4"} <= made


def test_the_best_video_is_made_once(run):
    directory, filmed = run
    build.build(directory, env="cartpole")
    build.build(directory, env="cartpole")
    assert filmed == ["cartpole"]


def test_a_film_of_a_policy_that_is_no_longer_the_best_is_not_kept(run, monkeypatch):
    directory, _ = run

    def render(*_: object, **__: object) -> bytes:
        (directory / "best" / "policy.safetensors").write_bytes(policy(4, 1, (16,)).to_bytes())
        return b"mp4"

    monkeypatch.setattr(video, "render", render)
    build.build(directory, "best", env="cartpole")
    assert not (directory / "best" / "video.mp4").exists()


def test_no_video_is_made_where_none_is_wanted(run):
    directory, filmed = run
    assert build.build(directory, "none", "cartpole") == []
    assert filmed == []


def test_a_machine_that_cannot_render_gets_everything_else(run, monkeypatch):
    directory, _ = run

    def refuse(*_: object, **__: object) -> bytes:
        raise video.NoRenderer("No video: install one.")

    monkeypatch.setattr(video, "render", refuse)
    assert build.build(directory, "all", "cartpole") == ["No video: install one."]
    assert "<h2>Generation 0, slot 1</h2>" in (directory / "report.html").read_text()
    assert (directory / "best" / "policy.onnx").exists()


def test_a_task_that_is_not_at_hand_leaves_what_was_made_of_it(run):
    directory, _ = run
    build.build(directory, "none", "cartpole")
    before = (directory / "best" / "policy.onnx").read_bytes()
    assert b"observation_clip" in before  # which is unknown without the task
    assert build.build(directory, "none")[0].startswith("No video and no new policy.onnx: the run's task is no")
    assert build.build(directory, "none", "moved.py")[0].startswith("There is no file ")
    assert (directory / "best" / "policy.onnx").read_bytes() == before


def test_a_policy_that_acts_otherwise_than_the_task_s_is_not_made_where_there_is_none(run):
    directory, _ = run
    build.build(directory, "none")
    assert not (directory / "best" / "policy.onnx").exists()
