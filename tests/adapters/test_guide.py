"""The commands and code in the guides to Gymnasium and to environments in another Python work as the guides say."""

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from openeureka.cli.main import main
from openeureka.llm.grammar import offered
from openeureka.tasks import registry
from openeureka.training.evaluate import evaluate
from openeureka.training.population import Population
from openeureka.types import Evaluation, LaneSpec, TrainBudget

GUIDES = Path(__file__).parents[2] / "docs" / "guides"
GUIDE = (GUIDES / "gymnasium.md").read_text()
ELSEWHERE = (GUIDES / "another-python.md").read_text()
WORDS = [shlex.split(line, comments=True) for line in GUIDE.splitlines() if re.match(r" +(eureka|env=)", line)]


class Here:
    """Trains in this process: to start worker processes would take longer than these trainings."""

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Iterator[Any]:
        yield from Population(env, lanes, budget, threads=1).train()

    def evaluate(self, env: str, policies: Mapping[str, bytes], **settings: Any) -> Iterator[Evaluation]:
        yield from evaluate(env, policies, threads=1, **settings)

    def rewards(self, *_: object) -> NoReturn:
        raise AssertionError("only a search with screen= asks")


def named(words: list[str]) -> list[str]:
    return [word.removeprefix("env=") for word in words if word.startswith("env=")]


def typed(words: list[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0


def test_the_state_table_is_the_one_that_is_printed(capsys: pytest.CaptureFixture[str]):
    command = next(words for words in WORDS if words[:2] == ["eureka", "context"])
    typed(command[1:])
    printed = capsys.readouterr().out
    for line in re.search(r"```\n(.*?)```", GUIDE, re.DOTALL)[1].splitlines():
        assert line in printed


def test_the_environments_own_reward_trains(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: Here())
    command = next(words for words in WORDS if words[:2] == ["eureka", "train"])
    shorter = {"steps=1e5": "steps=4096", "env=gym:CartPole-v1": "env=gym:CartPole-v1+episode_length=30"}
    typed([*(shorter.get(word, word) for word in command[1:]), f"dir={tmp_path}"])
    assert "human: F" in capsys.readouterr().out
    assert (tmp_path / "report.html").exists() and (tmp_path / "best" / "policy.onnx").exists()


def test_every_environment_of_the_page_is_found():
    found = [env for words in WORDS for env in named(words) if not env.startswith("gym:package:")]
    assert len(found) >= 9
    for env in found:
        if "LunarLander" in env:
            pytest.importorskip("Box2D", reason="needs Box2D: pip install 'openeureka[gym]'")
        if "minigrid" in env:
            pytest.importorskip("minigrid", reason="needs minigrid: pip install minigrid")
        assert registry.get(env).num_actions > 0


@pytest.fixture
def carts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Writes the guide's file into a new working directory."""
    (tmp_path / "carts.py").write_text(re.search(r"```python\n(.*?)```", ELSEWHERE, re.DOTALL)[1])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: Here())


def test_the_factory_of_the_page_is_an_environment(carts: None, capsys: pytest.CaptureFixture[str]):
    lines = [shlex.split(line) for line in ELSEWHERE.splitlines() if re.match(r" +eureka .*carts\.py:", line)]
    (context, train, run, new) = [words for words in lines if not any(word.startswith("python=") for word in words)]
    typed(context[1:])
    printed = capsys.readouterr().out
    for line in re.search(r"```\n(place.*?)```", ELSEWHERE, re.DOTALL)[1].splitlines():
        assert line in printed
    typed([*(word.replace("2e5", "4096") for word in train[1:]), "dir=trained"])
    assert "human: F" in capsys.readouterr().out
    searched = registry.get(named(run)[0]).spec
    assert "gap" not in searched  # F is computed from it
    assert [variable.name for variable in offered(searched)] == ["place", "speed", "ahead"]  # to the embedded model
    typed(new[1:])
    assert registry.get("mine.py").num_observations == 3
    (changed,) = re.findall(r"`env=(python:carts\.py:Carts\+pull=.*?)`", ELSEWHERE)
    assert registry.make(changed, worlds=1).step(torch.zeros(1, 1)).state["speed"].shape == (1,)


def test_a_reward_that_was_found_is_exported(carts: None, capsys: pytest.CaptureFixture[str]):
    small = ["sample=1", "iteration=1", "steps=2048", "seeds=1", "video=none", "env=gym:CartPole-v1+episode_length=30"]
    typed(["run", "model=random", *small, "dir=outputs/one"])
    export = next(shlex.split(line) for line in ELSEWHERE.splitlines() if line.startswith("    eureka export"))
    typed([*(re.sub("outputs/.*", "outputs/one", word) for word in export[1:])])
    assert "class EurekaReward(gymnasium.Wrapper)" in Path("outputs/one/best/reward_gymnasium.py").read_text()
    capsys.readouterr()
    with pytest.raises(SystemExit):
        main(["export", "outputs/one", "to=mjlab"])
    assert "comes from gymnasium, so use to=gymnasium, not to=mjlab." in capsys.readouterr().err
