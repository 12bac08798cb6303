"""What the guide on Gymnasium tells to type works as it says."""

import re
import shlex
from pathlib import Path

import pytest

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from openeureka.cli.main import main
from openeureka.tasks import registry

GUIDE = (Path(__file__).parents[2] / "docs" / "guides" / "gymnasium.md").read_text()
WORDS = [shlex.split(line, comments=True) for line in GUIDE.splitlines() if re.match(r" +(eureka|env=)", line)]


def named(words: list[str]) -> list[str]:
    return [word.removeprefix("env=") for word in words if word.startswith("env=")]


def test_the_state_table_is_the_one_that_is_printed(capsys: pytest.CaptureFixture[str]):
    command = next(words for words in WORDS if words[:2] == ["eureka", "context"])
    assert main(command[1:]) in (0, None)
    printed = capsys.readouterr().out
    for line in re.search(r"```\n(.*?)```", GUIDE, re.DOTALL)[1].splitlines():
        assert line in printed


def test_the_environments_own_reward_trains(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    command = next(words for words in WORDS if words[:2] == ["eureka", "train"])
    short = [word if not word.startswith("steps=") else "steps=4096" for word in command[1:]]
    assert main([*short, f"dir={tmp_path}"]) in (0, None)
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
