"""What scripts keep: a quick look, such as `--tiny`, is not kept; a part of a measurement replaces only its own rows;
known results are printed, not measured again."""

import json
import sys
from argparse import ArgumentTypeError
from pathlib import Path
from types import ModuleType
from typing import Any

import cost
import crashes
import fresh
import guards
import gym_lifted
import gym_solved
import headline
import local_model
import measurable
import parity
import predictors
import pytest
import randomise
import rungs
import throughput
import tune


def called(monkeypatch: pytest.MonkeyPatch, script: ModuleType, *words: str) -> None:
    monkeypatch.setattr(sys, "argv", [f"{script.__name__}.py", *words])
    script.main()


@pytest.mark.parametrize(
    ("script", "measures", "look"),
    [
        (guards, {"compare": {}}, ["--tiny"]),
        (randomise, {"compare": {}}, ["--tiny"]),
        (throughput, {"measure": {}, "report": {"ratio_of_medians": {}}, "sleep_when_idle": None}, ["--tiny"]),
        (local_model, {"measure": {"arms": {}, "human": None}}, ["--no-train", "--env", "ant"]),
    ],
    ids=lambda value: value.__name__ if isinstance(value, ModuleType) else "",
)
def test_a_look_is_kept_nowhere(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, script: ModuleType, measures: dict[str, Any], look: list[str]
):
    for name, found in measures.items():
        monkeypatch.setattr(script, name, lambda *_, found=found: found)
    out = tmp_path / "out.json"
    called(monkeypatch, script, *look, "--out", str(out))
    assert not out.exists()
    called(monkeypatch, script, "--out", str(out))
    assert out.exists(), "the whole measurement is kept"


def test_some_points_of_crashes_are_kept_in_a_file_of_theirs_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(crashes, "measure", lambda *_: {})
    monkeypatch.setattr(crashes, "RESULTS", tmp_path / "crashes.json")
    called(monkeypatch, crashes, "--stride", "5")
    assert not crashes.RESULTS.exists()
    called(monkeypatch, crashes, "--stride", "5", "--out", str(tmp_path / "some.json"))
    assert json.loads((tmp_path / "some.json").read_text())["stride"] == 5
    called(monkeypatch, crashes)
    assert json.loads(crashes.RESULTS.read_text())["stride"] == 1


def test_a_look_at_parity_is_kept_nowhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    runs = {name: [{"seconds": seconds}] for name, seconds in (("ours", 2.0), ("rsl_rl", 3.0))}
    found = {"env_steps": 9, "final_fitness": {"ours": [1.0, 2.0], "rsl_rl": [1.0, 2.0]}, "runs": runs}
    monkeypatch.setattr(parity, "sleep_when_idle", lambda: None)
    monkeypatch.setattr(parity, "compare", lambda *_: found | {"difference": 0.0, "standard_deviation": {}})
    out = tmp_path / "out.json"
    called(monkeypatch, parity, "--tiny", "--out", str(out))
    assert not out.exists()
    called(monkeypatch, parity, "--out", str(out))
    told = parity.sentence(json.loads(out.read_text()))
    # Both have a standard deviation of 0.7071, t(2, 0.975) = 4.3027: the half-width is 3.0424.
    assert "(2 seeds): a difference of 0 (-3 to 3). rsl_rl's takes 1.5 times as long." in told


def test_some_arms_of_throughput_take_a_file_of_theirs(monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.setattr(throughput, "measure", lambda *_: pytest.fail("measured"))
    with pytest.raises(SystemExit):
        called(monkeypatch, throughput, "--only", "start")
    assert "name a file of theirs with --out" in capsys.readouterr().err


@pytest.mark.parametrize(("script", "words"), [(cost, ["--env", "ant"]), (gym_lifted, ["Ant"])])
def test_one_row_replaces_no_other(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, script: ModuleType, words: list[str]
):
    out = tmp_path / "out.json"
    out.write_text(json.dumps({"other": {"ratio": 1}}))
    found = {"steps_per_second": {"lanes": 1}, "ratio": 2}
    monkeypatch.setattr(script, "measure", lambda *_: found)
    called(monkeypatch, script, *words, "--out", str(out))
    assert json.loads(out.read_text()) == {"other": {"ratio": 1}, words[-1]: found}


def test_one_model_replaces_no_other_and_other_settings_are_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    out = tmp_path / "out.json"
    known = {"seed": 0, "temperature": 1.0, "env_steps_per_lane": 600_000, "human": 3.0, "arms": {"random": 1}}
    out.write_text(json.dumps({"ant": known}))
    arm = {"accepted": 1, "samples": 1, "fitness": {"best": None, "median": None}}
    monkeypatch.setattr(local_model, "measure", lambda *_: {"human": 3.0, "arms": {"local": arm}})
    monkeypatch.setattr(local_model, "print", lambda *_, **__: None, raising=False)
    called(monkeypatch, local_model, "--env", "ant", "--model", "local", "--out", str(out))
    assert json.loads(out.read_text())["ant"] == {**known, "arms": {"random": 1, "local": arm}}
    with pytest.raises(SystemExit, match="ant was measured with seed 0, .*name another file"):
        called(monkeypatch, local_model, "--env", "ant", "--seed", "1", "--out", str(out))


def test_what_is_known_is_said_with_what_it_was_measured(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys):
    for script in (gym_solved, measurable):
        monkeypatch.setattr(script, "measure", lambda *_, **__: pytest.fail("trained"))
    monkeypatch.setattr(gym_solved, "show", lambda *_: None)
    monkeypatch.setattr(measurable, "show", lambda *_: None)
    called(monkeypatch, gym_solved, "--env", "gym:CartPole-v1", "--seeds", "5")
    assert "gym:CartPole-v1 is known with 3 seeds" in capsys.readouterr().out
    called(monkeypatch, measurable, "--env", "anymal", "--steps", "1e4")
    assert "anymal is known with 2,000,000 steps" in capsys.readouterr().out
    assert headline.confirm("ballbalance", 12).startswith("ballbalance, known with 9 seeds: 116 (")


def test_more_seeds_are_asked_of_what_is_known(monkeypatch: pytest.MonkeyPatch, capsys):
    monkeypatch.setattr(tune, "measure", lambda *_: pytest.fail("tuned"))
    monkeypatch.setattr(tune, "confirm", lambda *_: pytest.fail("trained"))
    with pytest.raises(SystemExit):
        called(monkeypatch, tune, "--confirm", "9", "--seed", "5")
    assert "ant/human/5 is not measured yet" in capsys.readouterr().err
    called(monkeypatch, tune, "--confirm", "12", "--tasks", "shadow_hand_over", "--kinds", "spoiled")
    assert "shadow_hand_over/spoiled/0: known with 9 seeds, 0.163 (" in capsys.readouterr().out


@pytest.mark.parametrize("text", ["1", "0", "-3", "nine", "2.5"])
def test_fewer_than_two_seeds_are_refused(text: str):
    with pytest.raises(ArgumentTypeError, match="from 2 on"):
        fresh.several(text)


def test_a_task_without_replies_says_that_the_human_reward_trains_alone(capsys):
    assert rungs.programs("cartpole") == {"human": "human"}
    assert "cartpole has no replies in" in capsys.readouterr().out


def test_a_signal_has_the_interval_over_tasks():
    # None counts as 0: mean 0.5, standard deviation 0.5, t(2, 0.975) = 4.3027: the half-width is 1.2421.
    assert predictors._over([1.0, 0.5, None]) == "0.5 (-0.74 to 1.7)"
    assert predictors._over([1.0]) == "1"
