"""What the guide on Gymnasium tells to type works as it says."""

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from openeureka.cli.main import main
from openeureka.tasks import registry
from openeureka.training.evaluate import evaluate
from openeureka.training.population import Population
from openeureka.types import Evaluation, LaneSpec, TrainBudget

GUIDE = (Path(__file__).parents[2] / "docs" / "guides" / "gymnasium.md").read_text()
WORDS = [shlex.split(line, comments=True) for line in GUIDE.splitlines() if re.match(r" +(eureka|env=)", line)]


class Here:
    """A trainer in this process: starting others takes longer than these trainings."""

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Iterator[Any]:
        yield from Population(env, lanes, budget, threads=1).train()

    def evaluate(self, env: str, policies: Mapping[str, bytes], **settings: Any) -> Iterator[Evaluation]:
        yield from evaluate(env, policies, threads=1, **settings)


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
