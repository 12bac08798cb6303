import os
import sqlite3
import tempfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
from report.scripted import search_in

from openeureka.config import NO_MODEL, RunConfig
from openeureka.errors import StoreError
from openeureka.events import nobody
from openeureka.method import given
from openeureka.method.lanes import Lanes
from openeureka.report.view import RunView
from openeureka.stats import mean
from openeureka.store import Store
from openeureka.store.db import FILENAME, LOG
from openeureka.testing.scripted import ScriptedModel, ToyTrainer, reply
from openeureka.ui import folder
from openeureka.ui.folder import RunState

CONFIG = RunConfig(env="toy", sample=2, iteration=1, refill=0, seeds=1)


class Dies(ScriptedModel):
    def sample(self, prompt, *, n, seed):
        raise KeyboardInterrupt


class Unplayed(ToyTrainer):
    def evaluate(self, env, policies, **asked):
        raise KeyboardInterrupt


def test_runs_are_listed_latest_first_and_other_folders_are_not(tmp_path):
    for name in ("b", "a"):
        search_in(tmp_path / name, [reply(1), reply(2)])
    (tmp_path / "notes").mkdir()
    os.utime(tmp_path / "a" / "run.sqlite", (1, 1))
    assert list(folder.runs(tmp_path)) == ["b", "a"]
    assert folder.runs(tmp_path / "absent") == {}


def test_a_folder_that_may_not_be_entered_hides_no_run():
    with tempfile.TemporaryDirectory() as name:  # pytest's own is closed to other users
        Path(name).chmod(0o755)
        for folder_name in ("mine", "closed"):
            (Path(name) / folder_name).mkdir()
        (Path(name) / "mine" / FILENAME).touch()
        (Path(name) / "closed").chmod(0o000)
        user = os.geteuid()
        os.seteuid(user or 65534)
        try:
            assert list(folder.runs(Path(name))) == ["mine"]
        finally:
            os.seteuid(user)
            (Path(name) / "closed").chmod(0o755)


def test_a_link_to_nowhere_in_one_run_hides_no_other(tmp_path):
    own, odd = search_in(tmp_path / "own", [reply(1), reply(2)]), search_in(tmp_path / "odd", [reply(1), reply(2)])
    (odd / LOG).unlink(missing_ok=True)
    (odd / LOG).symlink_to(LOG)  # a link to itself
    assert folder.runs(tmp_path).keys() == {"own", "odd"}
    assert folder.fingerprint(own) and folder.fingerprint(odd)


def test_a_link_to_a_name_that_is_too_long_hides_no_run(tmp_path):
    search_in(tmp_path / "own", [reply(1), reply(2)])
    (tmp_path / "odd").mkdir()
    (tmp_path / "odd" / LOG).touch()
    for link in (tmp_path / "nowhere", tmp_path / "odd" / FILENAME):
        link.symlink_to("x" * 300)
    assert folder.runs(tmp_path).keys() == {"own", "odd"}
    assert folder.entry("odd", tmp_path / "odd").state is RunState.UNBEGUN
    with pytest.raises(StoreError, match="is not a run"):
        RunView.read(tmp_path / "odd")


def test_two_runs_never_share_a_name(tmp_path):
    for place in ("a/b", "a:b"):
        search_in(tmp_path / place, [reply(1), reply(2)])
    assert folder.runs(tmp_path).keys() == {"a:b", "a::b"}


def test_runs_of_a_bench_are_listed_by_its_name_and_theirs(tmp_path):
    own = search_in(tmp_path / "bench" / "cell", [reply(1), reply(2)])
    search_in(own / "lanes" / "hidden", [reply(1), reply(2)])  # runs inside a run are not listed
    far = search_in(tmp_path / "a" / "b" / "c", [reply(1), reply(2)])
    search_in(tmp_path / "a" / "b" / "d" / "too_deep", [reply(1), reply(2)])
    (tmp_path / "round").symlink_to(tmp_path)
    assert folder.runs(tmp_path) == {"a:b:c": far, "bench:cell": own}


def test_a_folder_that_is_a_run_lists_itself(tmp_path, monkeypatch):
    search_in(tmp_path / "run", [reply(1), reply(2)])
    monkeypatch.chdir(tmp_path / "run")
    assert folder.runs(Path(".")) == {"run": Path(".")}


def test_a_finished_run_shows_its_best_and_what_it_cost(tmp_path):
    entry = folder.entry("run", search_in(tmp_path / "run", [reply(1), reply(2)]))
    assert entry.state is RunState.FINISHED
    assert entry.glance is not None
    assert (entry.glance.generations, entry.glance.fitness) == (1, 1.0)  # played: one less than in training
    assert entry.glance.usage.cost_usd == pytest.approx(0.02)  # two replies of a cent


def test_the_list_scores_a_run_as_its_own_page_does(tmp_path):
    for best, seeds, word in ((2, 2, "worse"), (20, 2, "better"), (20, 1, "not decided")):
        directory = search_in(tmp_path / f"{best}_{seeds}", [reply(1), reply(best)], seeds=seeds)
        glance, ends = folder.entry("run", directory).glance, RunView.read(directory).outcome
        assert glance is not None and ends is not None
        assert None not in (glance.held_out, glance.human)
        assert (glance.held_out, glance.human) == (mean(ends.method.held_out), mean(ends.human.held_out))
        assert glance.word == ends.word == word


def test_a_search_that_found_nothing_is_finished_too(tmp_path):
    entry = folder.entry("run", search_in(tmp_path / "run", ["nothing", "nothing"]))
    assert entry.state is RunState.FINISHED


def test_a_run_is_running_while_a_process_has_it_and_stopped_after_that(tmp_path):
    with Store.open(tmp_path / "run", CONFIG):
        assert folder.entry("run", tmp_path / "run").state is RunState.RUNNING
    assert folder.entry("run", tmp_path / "run").state is RunState.STOPPED


def test_a_run_that_was_killed_when_it_was_judged_is_stopped(tmp_path, monkeypatch):
    def killed(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(Store, "save_crown", killed)
    with pytest.raises(KeyboardInterrupt):
        search_in(tmp_path / "run", [reply(1), reply(2)])
    entry = folder.entry("run", tmp_path / "run")
    assert entry.glance is not None and entry.glance.evaluations > 0
    assert entry.state is RunState.STOPPED


@pytest.mark.parametrize("ended", [True, False])
def test_an_older_run_is_finished_where_its_last_rows_say_so(tmp_path, ended):
    if ended:
        search_in(tmp_path / "run", [reply(1), reply(2)])
    else:
        with pytest.raises(KeyboardInterrupt):
            search_in(tmp_path / "run", [], model=Dies([]))
    _make_older(tmp_path / "run")
    assert folder.entry("run", tmp_path / "run").state is (RunState.FINISHED if ended else RunState.STOPPED)


def test_an_older_run_of_given_rewards_is_finished_where_it_is_scored(tmp_path):
    config = replace(CONFIG, model=NO_MODEL)
    for name, interrupted in (("scored", False), ("trained", True)):
        with Store.open(tmp_path / name, config) as store, suppress(KeyboardInterrupt):
            given.keep(store, {"human": None})
            given.train(Lanes(config, store, Unplayed() if interrupted else ToyTrainer(), nobody))
        _make_older(tmp_path / name)
    assert folder.entry("scored", tmp_path / "scored").state is RunState.FINISHED
    assert folder.entry("trained", tmp_path / "trained").state is RunState.STOPPED


def test_the_list_says_what_a_search_of_an_older_version_decided(tmp_path):
    search_in(tmp_path / "run", [reply(1), reply(20)], seeds=2)
    _make_older(tmp_path / "run")
    entry = folder.listed("run", tmp_path / "run")
    assert entry.glance is not None and entry.glance.word == "better"


def _make_older(directory: Path) -> None:
    """Bring the rows of a run back to schema 12."""
    with sqlite3.connect(directory / FILENAME) as connection:
        for table in ("evaluations", "plays", "trials", "rungs"):
            for column in ("lost", "noisy"):
                connection.execute(f"ALTER TABLE {table} DROP COLUMN {column}")
        connection.execute("DROP TABLE ended")
        connection.execute("PRAGMA user_version = 12")
    connection.close()


def test_looking_does_not_keep_a_run_from_starting(tmp_path):
    search_in(tmp_path / "run", [reply(1), reply(2)])
    for _ in range(3):
        assert folder.entry("run", tmp_path / "run").state is RunState.FINISHED
        with Store.open(tmp_path / "run", CONFIG):
            pass


def test_a_directory_with_only_a_log_has_not_begun(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / LOG).write_text("There is no model of this name.")
    assert list(folder.runs(tmp_path)) == ["run"]
    assert folder.entry("run", tmp_path / "run").state is RunState.UNBEGUN
    assert folder.log(tmp_path / "run") == "There is no model of this name."
    with Store.open(tmp_path / "run", CONFIG):  # the log does not make it somebody else's
        pass


def test_a_damaged_run_is_named_and_does_not_hide_the_others(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "run.sqlite").write_text("no database " * 100)
    entry = folder.entry("run", tmp_path / "run")
    assert entry.state is RunState.UNREADABLE and "is damaged or not a run" in entry.problem


def test_only_the_end_of_a_long_log_is_read(tmp_path):
    (tmp_path / LOG).write_bytes(b"\xff" * 10_000 + b"end")
    assert folder.log(tmp_path, size=5) == "\ufffd\ufffdend"
    (tmp_path / LOG).write_text("".join(f"line {n}\n" for n in range(100)))
    assert folder.log(tmp_path, lines=2) == "line 98\nline 99\n"


def test_the_fingerprint_changes_with_a_commit_a_film_and_a_log_and_not_by_looking(tmp_path):
    directory = search_in(tmp_path / "run", [reply(1), reply(2)])
    seen = [folder.fingerprint(directory)]

    def differs() -> bool:
        seen.append(folder.fingerprint(directory))
        return seen[-1] != seen[-2]

    folder.entry("run", directory)
    assert not differs()
    (lane,) = {path for path in (directory / "lanes").iterdir() if path.name.startswith("human-s0")}
    robust = directory / "robust"
    robust.mkdir()
    assert differs()
    for place in (lane, robust):
        (place / "video.mp4").write_bytes(b"film")
        assert differs()
    (directory / LOG).write_text("more")
    assert differs()
    with Store.open(directory, replace(CONFIG, device="cuda")):
        assert differs()  # a process is running it
    assert differs()
