from dataclasses import dataclass
from pathlib import Path

import pytest

from openeureka.cli.main import main
from openeureka.cli.settings import ContextConfig, describe, only_path, split
from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.parsing import command_line


@dataclass(frozen=True, kw_only=True)
class Example:
    speed: int = 3
    """How fast [m/s].
    The second line is for readers of the code."""
    loud: bool = False


def test_settings_are_described_with_default_and_first_line():
    assert describe(Example).splitlines()[2:] == [
        f"  {'speed=3':<26} How fast [m/s].",
        "  loud=false",
    ]


def test_every_setting_of_a_run_is_described():
    assert len(describe(RunConfig).splitlines()) == 3 + len(RunConfig.__dataclass_fields__)  # heading and python=


def test_what_is_no_setting_of_its_own_stands_among_the_settings(capsys: pytest.CaptureFixture[str]):
    assert [line for line in describe(ContextConfig).splitlines() if "python=PATH" in line]
    assert "trust=" not in describe(RunConfig)
    for command in ("resume", "robust"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        assert "\n    trust=   " in capsys.readouterr().out


def test_words_are_separated_from_paths():
    settings, paths = split(["env=ant", "my_reward.py"])
    assert (settings, [str(path) for path in paths]) == (["env=ant"], ["my_reward.py"])


@pytest.mark.parametrize("place", ["lr=3", "runs/lr=3", "/tmp/lr=3", "-runs", "--runs"])
def test_a_directory_with_an_equals_sign_is_gone_on_with(place):
    *_, word = command_line("resume", Path(place)).split()
    settings, paths = split([word, "max_cost=3"])
    assert (settings, paths) == (["max_cost=3"], [Path(place)])


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([], "Name exactly one path; for example: eureka show DIR"),
        (["cartpole", "b.py"], "Name exactly one path, not cartpole and b.py; for example: eureka show DIR"),
        (
            ["env", "=", "ant", "b.py"],
            "Write a setting without spaces around its equals sign; for example: eureka show DIR",
        ),
    ],
)
def test_a_command_for_one_file_shows_how_to_name_it(words, sentence):
    with pytest.raises(ConfigError, match=f"^{sentence}$"):
        only_path(split(words)[1], "eureka show DIR")
