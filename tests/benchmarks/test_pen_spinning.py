"""Cycles per episode of the three arms, with toy trainings."""

import json
import shutil
from pathlib import Path

import pen_spinning
import pytest

from openeureka.testing.scripted import ToyTrainer


@pytest.fixture
def go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Runs the script. Policies of the human reward reach 9 + seed / 100 goals in held-out episodes."""
    trainer = ToyTrainer()
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: trainer)

    def go(*words: str) -> list[str]:
        """Returns the lanes that this call trained."""
        trainer.trained.clear()
        folder = str(tmp_path / "runs")
        pen_spinning.main(["--seeds", "2", *words, "--dir", folder, "--out", str(tmp_path / "pen.json")])
        return list(trainer.trained)

    return go


def test_both_stages_and_a_training_from_scratch_are_scored_in_cycles_of_twelve_goals(go, tmp_path: Path, capsys):
    assert go() == ["human-s0", "human-s1"] * 3
    found = json.loads((tmp_path / "pen.json").read_text())
    assert list(found["arms"]) == ["pre_trained", "fine_tuned", "scratch"]
    for arm in found["arms"].values():
        assert arm["lanes"]["s1"]["cycles"] == pytest.approx(9.01 / 12)
        assert arm["cycles"] == pytest.approx(9.005 / 12)
        assert {"date", "device", "versions"} <= set(arm)
    assert found["env_steps"] == 60_000_000 and found["seeds"] == 2
    assert "fine_tuned: 0.75" in capsys.readouterr().out
    assert len(list((tmp_path / "runs").rglob("curriculum/lanes/*/last.safetensors"))) == 2


def test_what_is_known_is_not_repeated(go, tmp_path: Path):
    go()
    path = tmp_path / "pen.json"
    found = json.loads(path.read_text())
    path.unlink()
    assert go() == [], "the runs hold the results"
    assert json.loads(path.read_text()) == found
    shutil.rmtree(tmp_path / "runs")
    assert go() == [], "the file holds them too"


def test_another_experiment_is_not_mixed_in(go):
    go()
    with pytest.raises(SystemExit, match="holds another experiment"):
        go("--steps", "1e6")


def test_a_refused_reward_file_is_not_trained(go, tmp_path: Path):
    (tmp_path / "bad.py").write_text("import os\n")
    with pytest.raises(SystemExit, match="was refused"):
        go("--reward", str(tmp_path / "bad.py"))
