"""Which reward of a run `eureka export` takes."""

import shutil
from pathlib import Path

import pytest
from report.scripted import search_in

import openeureka
from openeureka.cli import play
from openeureka.cli.export import _best
from openeureka.errors import ConfigError, StoreError
from openeureka.refine import hardening
from openeureka.store import Store
from openeureka.testing.scripted import program, reply


def test_the_reward_in_best_is_exported(tmp_path: Path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    assert _best(directory)[0] == program(8)
    (directory / "best" / "reward.py").write_text(program(7))  # as after fitted numbers replaced the winner's
    assert _best(directory)[0] == program(7)


def test_what_nobody_accepted_is_not_exported(tmp_path: Path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    (directory / "best" / "reward.py").write_text("import os")
    with pytest.raises(ConfigError, match="has no reward yet"):
        _best(directory)


def test_where_the_task_s_own_reward_is_the_best_there_is_nothing_to_export(tmp_path: Path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    (directory / "best" / "reward.py").unlink()  # as `eureka train reward=human` leaves it: a policy, no program
    with pytest.raises(ConfigError, match="came with the task, so there is nothing to export"):
        _best(directory)


def test_a_store_that_was_copied_alone_is_not_said_to_have_found_nothing(tmp_path: Path):
    directory = search_in(tmp_path / "run", [reply(7), reply(8)])
    (tmp_path / "copy").mkdir()
    shutil.copy(directory / "run.sqlite", tmp_path / "copy")

    def harden() -> None:
        with Store.view(tmp_path / "copy") as store:
            hardening._best(store)

    for use in (
        lambda: _best(tmp_path / "copy"),
        lambda: play.play([f"{tmp_path}/copy"]),
        lambda: openeureka.open_run(tmp_path / "copy").policy,
        harden,
    ):
        with pytest.raises(StoreError, match="holds only the rows of a run, .* Copy the whole folder"):
            use()
