"""Which reward of a run goes back to its suite."""

from pathlib import Path

import pytest
from report.scripted import search_in

from openeureka.cli.export import _best
from openeureka.errors import ConfigError
from openeureka.testing.scripted import program, reply


def test_the_reward_in_best_is_exported(tmp_path: Path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    assert _best(directory)[0] == program(8)
    (directory / "best" / "reward.py").write_text(program(7))  # as where fitted numbers took the place of the crown's
    assert _best(directory)[0] == program(7)


def test_what_nobody_accepted_is_not_exported(tmp_path: Path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    (directory / "best" / "reward.py").write_text("import os")
    with pytest.raises(ConfigError, match="has found no reward yet"):
        _best(directory)


def test_where_the_task_s_own_reward_is_the_best_there_is_nothing_to_export(tmp_path: Path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    (directory / "best" / "reward.py").unlink()  # as `eureka train reward=human` leaves it: a policy, and no text
    with pytest.raises(ConfigError, match="is the task's own; there is nothing to export"):
        _best(directory)
