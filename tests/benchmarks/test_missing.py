"""The queue of long measurements: what is known is not asked for again."""

import json
import sys
from pathlib import Path

import claims
import greedy
import longer
import make_run
import measurable
import mended
import missing
import polish
import progress
import prompts
import pytest
import table
import tune
import with_noise


@pytest.fixture
def results(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    for script in (claims, greedy, longer, measurable, mended, polish, progress, prompts, table, tune, with_noise):
        monkeypatch.setattr(script, "RESULTS", tmp_path / f"{script.__name__}.json")
    return tmp_path


@pytest.fixture(autouse=True)
def searches(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Results of make_run.py, known for all its seeds."""
    path = tmp_path / "make_run.json"
    path.write_text(json.dumps({str(seed): {"settings": " ".join(make_run.settings())} for seed in make_run.SEEDS}))
    monkeypatch.setattr(make_run, "RESULTS", path)
    return path


def test_where_nothing_is_known_everything_is_missing(results: Path):
    commands = list(missing.left())
    # measurable.py 3 tasks, headline.py 31, longer.py 6, mended.py 10, with_noise.py 14,
    # claims.py 3 x 5 groups and 4 x 2, tune.py 2 x 2, polish.py 3, progress.py one per folder of rewards,
    # prompts.py 3 x 2
    assert len(commands) == 3 + 31 + 6 + 10 + 14 + 15 + 8 + 4 + 3 + len(progress.tasks()) + 6
    assert all((missing.FOLDER / script).is_file() for script, *_ in commands)


def test_what_is_known_is_not_among_them(results: Path):
    (results / "measurable.json").write_text(json.dumps({"ant": {}, "humanoid": {}}))
    (results / "tune.json").write_text(json.dumps({"ant/human/0": {}, "ant/spoiled/1": {}}))
    commands = list(missing.left())
    assert [words for script, *words in commands if script == "measurable.py"] == [["--env", "anymal"]]
    assert not any(script == "greedy.py" for script, *_ in commands)
    lanes = {lane: {"fitness": 1.0, "trained": {"recipe": prompts.recipe("ant")}} for lane in ("human-s0", "a-s0")}
    (results / "prompts.json").write_text(json.dumps({"ant": {"rewards": {"small": ["a"]}, "lanes": lanes}}))
    asked = [words[1::2] for script, *words in missing.left() if script == "prompts.py"]
    assert asked == [["anymal", "0"], ["ballbalance", "0"], ["ant", "1"], ["anymal", "1"], ["ballbalance", "1"]]
    tunings = [words[1::2] for script, *words in commands if script == "tune.py"]
    assert tunings == [["ant", "spoiled"], ["shadow_hand_over", "human"], ["shadow_hand_over", "spoiled"]]


def test_what_was_broken_off_halfway_is(results: Path):
    (env, other, *_) = progress.tasks()
    arms = {name: {} for name in progress.ARMS}
    (results / "progress.json").write_text(json.dumps({env: {"arms": {"none": {}}}, other: {"arms": arms}}))
    waiting = {"ant": {"best": "g0s1", "eureka": "g0s2"}, "anymal": {"best": "g0s1", "eureka": "g0s1"}}
    (results / "greedy.json").write_text(json.dumps(waiting))
    commands = list(missing.left())
    assert ["progress.py", "--env", env] in commands and ["progress.py", "--env", other] not in commands
    assert ["greedy.py", "--env", "ant"] in commands and ["greedy.py", "--env", "anymal"] not in commands


def test_seeds_of_make_run_with_other_settings_are_missing(results: Path, searches: Path):
    assert not any(script == "make_run.py" for script, *_ in missing.left())
    searches.write_text(json.dumps({"10": {"settings": " ".join(make_run.settings())}, "0": {"settings": "env=ant"}}))
    assert [words[-1] for script, *words in missing.left() if script == "make_run.py"] == ["0", "20", "30", "40"]


def test_a_script_that_fails_does_not_stop_the_others_and_is_tried_once(results: Path, monkeypatch):
    ran: list[str] = []
    monkeypatch.setattr(missing.subprocess, "run", lambda command, **_: ran.append(Path(command[1]).name))
    monkeypatch.setattr(missing.os, "nice", lambda _: 0)
    monkeypatch.setattr(sys, "argv", ["missing.py"])
    missing.main()
    assert len(ran) == len(list(missing.left()))
