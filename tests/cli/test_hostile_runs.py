"""Whatever a run directory from elsewhere holds: nothing outside it is read, written, imported or contacted."""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from hostile_runs import CASES, SECRET, HostileRun, bystanders
from report.policies import policy
from report.scripted import search_in
from toys import ToySandbox, eureka
from ui.serving import visitor

from openeureka.cli import play
from openeureka.film import video
from openeureka.runs import compose
from openeureka.testing.scripted import ScriptedModel, ToyTrainer, reply
from openeureka.training.policy import Policy

DRIVES = {"\x1b", "\x07", "\x9b", "\u202e"}
"""Characters that would drive a terminal."""


class Confined(ToySandbox):
    def __enter__(self) -> ToySandbox:
        assert not self.unsafe, "a store has switched the sandbox off"
        return self


class Known(ToyTrainer):
    """A trainer that gets the installed task only, whatever the run names."""

    def train(self, env, lanes, budget):
        assert env == "cartpole"
        yield from super().train(env, lanes, budget)


@pytest.fixture(scope="module")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("honest") / "run"
    with contextlib.suppress(IndexError):  # the model's script has ended
        search_in(directory, [reply(7), reply(8)], env="cartpole", iteration=2, video="all")
    (directory / "best" / "policy.safetensors").write_bytes(Policy("cartpole", policy(4, 1, (8,)).tensors).to_bytes())
    return directory


@pytest.fixture
def things(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The person's working directory, with files that no run may reach. They must be unchanged at the end."""
    monkeypatch.setenv("CANARY", SECRET)
    monkeypatch.setenv("OPENAI_API_KEY", f"sk-{SECRET}")
    monkeypatch.setattr(compose, "open_model", lambda config, held: ScriptedModel([reply(5), reply(6)]))
    monkeypatch.setattr(compose, "Sandbox", Confined)
    monkeypatch.setattr(compose, "record_states", lambda env: {})
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: Known())
    monkeypatch.setattr(play.viewer, "has_display", lambda: False)
    for module in (video, play):
        monkeypatch.setattr(module, "render", rendered)
    folder = tmp_path / "things"
    bystanders(folder)
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(folder)
    before = snapshot(folder)
    yield folder
    assert snapshot(folder) == before
    assert not (tmp_path / "mark").exists(), "a file that the run named was imported"


def rendered(env: str, *_: object, **__: object) -> bytes:
    assert env == "cartpole"
    return b"mp4"


def snapshot(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() if path.is_file() else b"" for path in sorted(folder.rglob("*"))}


def assert_harmless(text: str) -> None:
    assert SECRET not in text
    assert not DRIVES & set(text)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_directory_from_elsewhere_does_no_harm(case: HostileRun, honest: Path, things: Path, capfd):
    run = things
    for verb in case.verbs:
        if verb not in ("page", "play"):  # page and play only read: they take the last verb's run
            run = things.parent / verb / "run"
            shutil.copytree(honest, run)
            case.harm(run, things)
        if verb == "page":
            client = visitor(run.parent)
            pages = [client.get(path) for path in ("/", "/runs/run/", "/runs/run/best/video.mp4")]
            said = "".join(page.text for page in pages)
            assert all(page.status_code in (200, 404) for page in pages)
        else:
            code = eureka(verb, run)
            said = "".join(capfd.readouterr())
            wanted = case.resume if verb == "resume" else case.read if verb != "play" else ""
            assert wanted in said and (bool(wanted) == bool(code) or verb in ("play", "report")), said
            assert "Traceback" not in said
        assert_harmless(said)
        for path in run.rglob("*"):
            if path.is_file() and not path.is_symlink() and path.suffix in (".html", ".json", ".log", ".py"):
                assert SECRET not in path.read_text()
