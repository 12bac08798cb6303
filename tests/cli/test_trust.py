"""A person goes on with their own run unasked. For a run from elsewhere, commands show what it would reach, and the
person agrees or refuses."""

from __future__ import annotations

import builtins
import contextlib
import shutil
import sys
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from loop.alone import run as run_search
from toys import ToySandbox

from openeureka import homes, strategies
from openeureka.cli import train
from openeureka.cli.play import play
from openeureka.cli.show import report, show
from openeureka.config import RunConfig, TrainConfig
from openeureka.errors import ConfigError, ModelError
from openeureka.film import video
from openeureka.llm import weights
from openeureka.runs import compose, trust
from openeureka.store import Store
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, program, reply

TASK = Path(__file__).parents[2] / "examples" / "pendulum.py"
SETTINGS = ["sample=2", "iteration=2", "seeds=1", "video=none", "baselines=train"]
ADDRESS = "http://127.0.0.1:9/v1"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The endpoints that were opened."""
    opened: list[str] = []

    def open_model(config: RunConfig, held: int) -> ScriptedModel:
        opened.append(config.base_url)
        return ScriptedModel([reply(n) for n in range(1, 9)][held:])

    monkeypatch.setattr(compose, "open_model", open_model)
    monkeypatch.setattr(compose, "context", lambda env: TOY)
    monkeypatch.setattr(compose, "Sandbox", ToySandbox)
    monkeypatch.setattr(compose, "record_states", lambda env: {})
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: ToyTrainer())
    return opened


def foreign(directory: Path, **settings: object) -> Path:
    """A run that somebody else started and interrupted."""
    given = {"iteration": 2, "sample": 2, "seeds": 1, "model": "m", "base_url": ADDRESS, "video": "none", **settings}
    config = RunConfig(**given)  # type: ignore[arg-type]
    with Store.open(directory, config) as store, contextlib.suppress(IndexError):
        model = ScriptedModel([reply(1), reply(2)])
        run_search(config, store, model, ToyChecker(), ToyTrainer(), TOY, strategies.Best(config.sample))
    return directory


@pytest.mark.parametrize("answer", [{"side_effect": RuntimeError("no home")}, {"return_value": "~/.local/state/x"}])
def test_a_user_without_a_home_is_asked_each_time(
    answer: dict[str, Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    for kind in ("user_state_dir", "user_cache_dir"):  # one answer of new, one of old versions of platformdirs
        monkeypatch.setattr(homes.platformdirs, kind, Mock(**answer))
    config = RunConfig(base_url=ADDRESS, model="m")
    trust.remember(config)
    assert trust.unknown(config)["base_url"] == ADDRESS
    monkeypatch.delenv("EUREKA_CACHE", raising=False)
    with pytest.raises(ModelError, match="set EUREKA_CACHE to a folder"):
        weights.cache_dir()
    assert not list(tmp_path.iterdir())


def at_a_terminal(monkeypatch: pytest.MonkeyPatch, answer: str) -> list[str]:
    """Fake a terminal at which a person gives this answer. Returns the questions that are asked."""
    questions: list[str] = []
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr(builtins, "input", lambda question: questions.append(question) or answer)
    return questions


def test_a_run_of_ones_own_goes_on_unasked_also_moved_and_copied(asked, tmp_path, monkeypatch):
    questions = at_a_terminal(monkeypatch, "n")
    own = [f"env={TASK}", "model=m", f"base_url={ADDRESS}", "price=1,2", *SETTINGS]
    train.run([*own, f"dir={tmp_path}/run"])
    (tmp_path / "run").rename(tmp_path / "moved")
    shutil.copytree(tmp_path / "moved", tmp_path / "copy")
    for place in ("moved", "copy"):
        train.resume([f"{tmp_path}/{place}"])
    assert asked == [ADDRESS] * 3 and questions == []


def test_an_address_from_elsewhere_is_refused_in_a_script_and_trusted_by_name(asked, tmp_path):
    run = foreign(tmp_path / "run", env="cartpole")
    with pytest.raises(ConfigError) as refused:
        train.resume([str(run)])
    assert f"base_url={ADDRESS}" in str(refused.value) and f"it comes from, add trust={run}." in str(refused.value)
    for words in ([f"trust={tmp_path}"], [f"trust={tmp_path}", f"trust={run}"]):
        with pytest.raises(ConfigError, match="does not name this run"):
            train.resume([str(run), *words])
    assert asked == []
    train.resume([str(run), f"trust={run}"])
    train.resume([str(run)])  # a person who agreed once is not asked again
    assert asked == [ADDRESS, ADDRESS]


@pytest.mark.parametrize(
    ("answer", "opened"), [("y", [ADDRESS]), ("Yes", [ADDRESS]), ("", []), ("n", []), ("what?", [])]
)
def test_at_a_terminal_a_person_is_shown_what_is_used_and_asked(asked, tmp_path, monkeypatch, capsys, answer, opened):
    notes = tmp_path / "notes\x1b[2J"
    notes.write_text(program(3))
    run = foreign(tmp_path / "run", env="cartpole", init=str(notes), model="m\u202e")
    questions = at_a_terminal(monkeypatch, answer)
    with contextlib.nullcontext() if opened else pytest.raises(ConfigError, match="Nothing was done"):
        train.resume([str(run)])
    assert asked == opened and len(questions) == 1
    shown = capsys.readouterr().out
    assert f"  base_url={ADDRESS}\n    which is sent the prompts and your key\n" in shown
    assert "notes\\x1b[2J" in shown and "\\u202e" in shown and "\x1b[2J" not in shown and "\u202e" not in shown


def test_what_the_command_itself_says_is_not_asked_about(asked, tmp_path):
    run = foreign(tmp_path / "run", env="cartpole", model="local")
    train.resume([str(run), "base_url=http://127.0.0.1:8/v1"])
    assert asked == ["http://127.0.0.1:8/v1"]


def test_no_store_switches_the_sandbox_off(asked, tmp_path, monkeypatch):
    seen: list[object] = []

    def noted(sandbox: ToySandbox) -> ToySandbox:
        seen.append(sandbox.unsafe)
        return sandbox

    monkeypatch.setattr(ToySandbox, "__enter__", noted)
    run = foreign(tmp_path / "run", env="cartpole", model="local", base_url="", unsafe_no_sandbox=True)
    train.resume([str(run)])
    train.resume([str(run), "unsafe_no_sandbox=true"])
    assert seen == [False, True]


def test_a_report_imports_the_file_of_a_run_that_was_started_here_or_that_is_typed(tmp_path, monkeypatch, capsys):
    filmed: list[str] = []
    monkeypatch.setattr(video, "render", lambda env, *_, **__: filmed.append(env) or b"mp4")
    run = foreign(tmp_path / "run", env=str(TASK))
    report([str(run), "video=all"])
    assert filmed == [] and "Add env=FILE.py" in capsys.readouterr().out
    report([str(run), "video=all", f"env={TASK}"])
    assert set(filmed) == {str(TASK)}
    for film in run.rglob("video.mp4"):
        film.unlink()
    trust.remember(RunConfig(env=str(TASK)))
    filmed.clear()
    report([str(run), "video=all"])
    assert set(filmed) == {str(TASK)}


def test_a_policy_from_elsewhere_imports_nothing_unasked(tmp_path, monkeypatch):
    from report.policies import policy

    from openeureka.training.policy import Policy

    file = tmp_path / "p.safetensors"
    (tmp_path / "evil.py").write_text(f"open({str(tmp_path / 'mark')!r}, 'w')\n")
    for env in (f"{tmp_path}/evil.py:Task", "evil:Task", "cartpole+/../evil.py"):
        file.write_bytes(Policy(env, policy(4, 1, (8,)).tensors).to_bytes())
        monkeypatch.chdir(tmp_path)
        with pytest.raises(ConfigError, match="is not an installed task and was never typed here"):
            play([f"policy={file}"])
    assert not (tmp_path / "mark").exists()


def test_the_same_relative_path_elsewhere_is_another_file(tmp_path, monkeypatch):
    for folder in ("mine", "theirs"):
        (tmp_path / folder).mkdir()
    monkeypatch.chdir(tmp_path / "mine")
    trust.remember(RunConfig(model="local:weights.gguf", init="first.py"))
    assert trust.unknown(RunConfig(model="local:weights.gguf", init="first.py")) == {}
    monkeypatch.chdir(tmp_path / "theirs")
    assert set(trust.unknown(RunConfig(model="local:weights.gguf", init="first.py"))) == {"model", "init"}


STRANGE = """
open({mark!r}, "w").close()
from openeureka.strategies import Best
from openeureka.testing.scripted import ToyTrainer

def search(config):
    return Best(config.sample)

def executor(**options):
    return ToyTrainer()
"""


@pytest.mark.parametrize("place", ["strange_{setting}", "{folder}/strange_{setting}.py"])
@pytest.mark.parametrize("setting", ["search", "executor"])
def test_code_that_a_run_names_is_imported_when_somebody_agrees(asked, tmp_path, monkeypatch, capsys, setting, place):
    mark, named = tmp_path / "mark", f"{place.format(setting=setting, folder=tmp_path)}:{setting}"
    monkeypatch.delitem(sys.modules, f"strange_{setting}", raising=False)
    (tmp_path / f"strange_{setting}.py").write_text(STRANGE.format(mark=str(mark)))
    monkeypatch.syspath_prepend(tmp_path)
    run = foreign(tmp_path / "run", env="cartpole", model="local", base_url="", **{setting: named})
    show(run)
    report([str(run)])
    with pytest.raises(
        ConfigError, match=f"were never typed here: {setting}={named}. If you know where it comes from, add trust="
    ):
        train.resume([str(run)])
    questions = at_a_terminal(monkeypatch, "n")
    with pytest.raises(ConfigError, match="Nothing was done"):
        train.resume([str(run)])
    assert f"  {setting}={named}\n    which is run with your rights\n" in capsys.readouterr().out
    assert len(questions) == 1 and not mark.exists()
    train.resume([str(run), f"trust={run}"])
    assert mark.exists() and "best F" in capsys.readouterr().out


def test_a_relative_file_of_code_elsewhere_is_another_file(tmp_path, monkeypatch):
    config = RunConfig(model="mine.py:Model", search="mine.py:Search", executor="mine.py:Executor")
    for folder in ("mine", "theirs"):
        (tmp_path / folder).mkdir()
    monkeypatch.chdir(tmp_path / "mine")
    trust.remember(config)
    assert trust.unknown(config) == {}
    monkeypatch.chdir(tmp_path / "theirs")
    assert set(trust.unknown(config)) == {"model", "search", "executor"}


def test_searches_and_executors_that_are_installed_need_no_consent():
    assert trust.claims(RunConfig(model="local", search="eureka", executor="local")) == {}
    assert trust.claims(TrainConfig(executor="mine:Executor")) == {"executor": "mine:Executor"}


@pytest.mark.parametrize(("address", "claimed"), [("auto", {}), ("local", {}), ("far:6379", {"address": "far:6379"})])
def test_a_cluster_elsewhere_needs_consent(address: str, claimed: dict[str, str]):
    assert trust.claims(RunConfig(model="local", executor="ray", address=address)) == claimed


@pytest.mark.parametrize("env", ["cartpole", "cartpole+episode_length=100", "shadow_hand_spin"])
def test_an_installed_task_needs_no_consent(env):
    assert trust.claims(RunConfig(env=env)) == {}


def test_a_home_that_cannot_be_written_is_no_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    trust.remember(RunConfig(base_url=ADDRESS))
    assert trust.unknown(RunConfig(base_url=ADDRESS)) == {"base_url": ADDRESS}
