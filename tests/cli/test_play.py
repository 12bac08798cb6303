import os

import pytest
import torch

from openeureka.cli import play
from openeureka.config import RunConfig
from openeureka.errors import ConfigError, RewardFileError, StoreError
from openeureka.film import web
from openeureka.store import Store
from openeureka.training.policy import Policy


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[object, ...]]:
    """Calls of the renderer, which is a fake."""
    calls: list[tuple[object, ...]] = []

    def render(env: str, policy: str | bytes, *, beside: str | bytes | None, seconds: float, **_: object) -> bytes:
        assert beside is None
        calls.append((env, policy, seconds))
        return b"mp4"

    monkeypatch.setattr(play, "render", render)
    monkeypatch.setattr(play.viewer, "has_display", lambda: False)
    return calls


def policy_of(env: str) -> bytes:
    """A policy file. Its network is never run."""
    tensors = {"w0": torch.zeros(4, 2), "b0": torch.zeros(2), "log_std": torch.zeros(1)}
    return Policy(env, tensors).to_bytes()


def test_the_best_policy_of_a_run_is_shown_on_its_own_task(asked, tmp_path, capsys):
    (tmp_path / "best").mkdir()
    (tmp_path / "best" / "policy.safetensors").write_bytes(policy_of("ant"))
    play.play([str(tmp_path), "seconds=3"])
    assert asked == [("ant", policy_of("ant"), 3.0)]
    assert (tmp_path / "play.mp4").read_bytes() == b"mp4"
    assert not (tmp_path / "best" / "video.mp4").exists()  # that is the report's video, of another length
    assert capsys.readouterr().out == f"Filming 3 s\nWrote {tmp_path / 'play.mp4'}\n"


def test_a_place_that_may_not_be_written_is_refused_before_anything_is_filmed(asked, tmp_path, capsys, monkeypatch):
    (tmp_path / "best").mkdir()
    (tmp_path / "best" / "policy.safetensors").write_bytes(policy_of("ant"))
    monkeypatch.setattr(os, "access", lambda path, mode: not mode & os.W_OK)
    for words in ([], [f"out={tmp_path}/new/ant.mp4"]):
        with pytest.raises(StoreError, match="cannot be written; check its permissions"):
            play.play([str(tmp_path), *words])
    assert asked == [] and capsys.readouterr().out == ""


def test_the_policy_that_was_carried_on_is_shown_where_it_is_better(asked, tmp_path):
    Store.open(tmp_path, RunConfig(env="ant")).close()
    for word, maker in (("polished", "`polish=N`"), ("robust", "`eureka robust`")):
        with pytest.raises(ConfigError, match=f"has no {word} policy: {maker} leaves"):
            play.play([str(tmp_path), f"policy={word}"])
    (tmp_path / "polished").mkdir()
    (tmp_path / "polished" / "policy.safetensors").write_bytes(policy_of("ant"))
    play.play([str(tmp_path), "policy=polished", f"out={tmp_path}/a.mp4"])
    assert asked == [("ant", policy_of("ant"), 10.0)]


def test_random_play_needs_no_file(asked, tmp_path):
    play.play(["env=ant", "policy=random", f"out={tmp_path}/a.mp4"])
    assert asked == [("ant", "random", 10.0)]


def test_random_play_beside_a_run_is_of_its_task(asked, tmp_path):
    Store.open(tmp_path / "run", RunConfig(env="ant")).close()
    play.play([f"{tmp_path}/run", "policy=random"])
    assert asked == [("ant", "random", 10.0)]


def test_a_policy_of_another_task_or_another_program_is_refused(asked, tmp_path):
    (tmp_path / "ant.safetensors").write_bytes(policy_of("ant"))
    with pytest.raises(ConfigError, match="trained on env=ant, not on env=cartpole"):
        play.play(["env=cartpole", f"policy={tmp_path}/ant.safetensors"])
    (tmp_path / "other").write_bytes(b"other")
    with pytest.raises(RewardFileError, match="not a policy file"):
        play.play([f"policy={tmp_path}/other"])
    assert asked == []


def test_a_task_whose_file_has_moved_is_found_where_env_says(asked, tmp_path):
    (tmp_path / "mine.safetensors").write_bytes(policy_of("/old/mine.py:Mine"))
    play.play(["env=/new/mine.py:Mine", f"policy={tmp_path}/mine.safetensors", f"out={tmp_path}/a.mp4"])
    assert [env for env, *_ in asked] == ["/new/mine.py:Mine"]


def test_a_policy_file_is_decoded_once_to_find_its_task(asked, tmp_path, monkeypatch):
    decoded: list[bytes] = []
    decode = Policy.from_bytes
    monkeypatch.setattr(Policy, "from_bytes", staticmethod(lambda data: decoded.append(data) or decode(data)))
    (tmp_path / "ant.safetensors").write_bytes(policy_of("ant"))
    play.play([f"policy={tmp_path}/ant.safetensors", f"out={tmp_path}/a.mp4"])
    assert decoded == [policy_of("ant")] and asked[0][0] == "ant"


def test_a_run_without_a_policy_says_so(asked, tmp_path):
    Store.open(tmp_path / "run", RunConfig(env="ant")).close()
    with pytest.raises(ConfigError, match="has no policy yet; `eureka show"):
        play.play([f"{tmp_path}/run"])


def test_what_is_no_run_is_called_so(asked, tmp_path):
    for directory, why in ((tmp_path, "it has no run.sqlite"), (tmp_path / "none", "there is no such directory")):
        with pytest.raises(StoreError, match=f"is not a run: {why}"):
            play.play([str(directory)])


def test_a_name_that_fits_no_file_says_what_does(asked, tmp_path):
    with pytest.raises(ConfigError, match=r"out=.*a\.gif must end in \.mp4"):
        play.play(["env=ant", "policy=zero", f"out={tmp_path}/a.gif"])
    (tmp_path / "b.mp4").mkdir()
    with pytest.raises(ConfigError, match=r"out=.*b\.mp4 must end in \.mp4, and be no folder"):
        play.play(["env=ant", "policy=zero", f"out={tmp_path}/b.mp4"])
    (tmp_path / "file").touch()
    with pytest.raises(StoreError, match="file is a file, not a folder; name another place"):
        play.play(["env=ant", "policy=zero", f"out={tmp_path}/file/new/a.mp4"])
    assert asked == [], "refused before anything is filmed"
    with pytest.raises(ConfigError, match="no policy file sparse; beside= takes human, random, zero"):
        play.play(["env=ant", "policy=zero", "beside=sparse", f"out={tmp_path}/a.mp4"])


@pytest.fixture
def shown(asked, monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """Windows and pages that would have opened on a machine with a display."""
    calls: list[tuple[str, str]] = []
    monkeypatch.setattr(play.viewer, "has_display", lambda: True)
    monkeypatch.setattr(play, "Stage", lambda env, policy, seed: f"{env} {policy} {seed}")
    monkeypatch.setattr(play.viewer, "window", lambda stage: calls.append(("window", stage)))
    monkeypatch.setattr(web, "page", lambda stage, port: calls.append((f"page at {port}", stage)))
    return calls


def test_where_there_is_a_display_a_window_opens(asked, shown):
    play.play(["env=ant", "policy=random", "seed=3"])
    assert (shown, asked) == ([("window", "ant random 3")], [])


def test_out_wants_a_video_whatever_there_is(asked, shown, tmp_path):
    play.play(["env=ant", "policy=zero", f"out={tmp_path}/a.mp4"])
    assert (shown, asked) == ([], [("ant", "zero", 10.0)])


def test_web_serves_a_page_with_or_without_a_display(asked, shown, monkeypatch):
    monkeypatch.setattr(play.viewer, "has_display", lambda: False)
    play.play(["env=ant", "policy=zero", "port=9000"], web=True)
    assert (shown, asked) == ([("page at 9000", "ant zero 0")], [])


@pytest.mark.parametrize(
    ("word", "web", "sentence"),
    [
        ("out=a.mp4", True, "leave --web out"),
        ("beside=zero", True, "leave --web out"),
        ("port=9000", False, "add --web"),
        ("seconds=3", False, "add out=FILE.mp4"),
        ("seconds=3", True, "add out=FILE.mp4"),
    ],
)
def test_a_setting_of_another_way_to_show_is_refused(asked, shown, word, web, sentence):
    with pytest.raises(ConfigError, match=sentence):
        play.play(["env=ant", "policy=zero", word], web=web)
    assert (shown, asked) == ([], [])


@pytest.mark.parametrize("words", [["env=cartpole"], ["policy=random"], ["policy=zero"], []])
def test_without_a_policy_or_its_task_it_says_what_may_be_played(words: list[str]):
    with pytest.raises(ConfigError, match=r"^Name what to play: a run directory, policy=FILE, or env=NAME policy=rand"):
        play.play(words)
