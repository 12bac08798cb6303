"""Both arms train the same reward files, known results are not measured again, and a row sums up both arms."""

import json
import re
from pathlib import Path

import progress
import pytest

from openeureka.config import TrainConfig
from openeureka.reward import gate
from openeureka.tasks.registry import get
from openeureka.training.rewards import VALUES
from openeureka.types import Evaluation, TrainingResult, TrainingState

ENV = "shadow_hand_over"


@pytest.fixture
def go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    configs: list[TrainConfig] = []

    def learn(config: TrainConfig, peaks):
        """F is 0 without the bonus, and 0.25 plus the seed with it."""
        configs.append(config)
        found = {}
        for path in map(Path, config.reward.split(",")):
            for seed in range(config.seeds):
                lane, curves = f"{path.stem}-s{seed}", {"component/progress_way": (0.1, None, 0.4 + seed)}
                score = 0.25 + seed if config.bonus == "progress" else 0.0
                played = Evaluation(lane=lane, fitness=score, episode_length=9.0, episodes=2)
                done = TrainingState.FINISHED
                result = TrainingResult(lane=lane, state=done, fitness=score, curves=curves, env_steps=1, seconds=1.0)
                found[lane] = (result, {"reward": played})
        return found

    def go(*words: str) -> list[TrainConfig]:
        """Returns the settings of what this call trained."""
        configs.clear()
        folder = str(tmp_path / "runs")
        progress.main(["--env", ENV, "--seeds", "2", *words, "--dir", folder, "--out", str(tmp_path / "found.json")])
        return list(configs)

    monkeypatch.setattr(progress, "learn", learn)
    return go


def test_only_the_bonus_differs_between_the_arms(go):
    plain, paid = go()
    assert (plain.bonus, paid.bonus) == ("none", "progress")
    assert [Path(word).name for word in plain.reward.split(",")] == ["distance.py", "throw.py"]
    assert (plain.reward, plain.seeds, plain.steps, plain.worlds) == (paid.reward, 2, 1_000_000, paid.worlds)
    assert plain.dir != paid.dir


def test_what_is_known_is_not_repeated_and_what_is_left_is_told(go, tmp_path: Path, capsys):
    assert go("--left") == []
    assert f"{ENV}, bonus=none: to do" in capsys.readouterr().out
    go()
    path = tmp_path / "found.json"
    found = json.loads(path.read_text())
    assert all({"device", "date", "versions"} <= set(arm) for arm in found[ENV]["arms"].values())
    # F is 0.25 and 1.25 with the two seeds. Progress is 0.4 and 1.4, clipped to 1: the mean is 0.7.
    assert f"{ENV} | 1,000,000 | throw | 0 ± 0 | 0.75 ± 0.71 | way 0.7 | way 0.7" in capsys.readouterr().out
    del found[ENV]["arms"]["none"]
    path.write_text(json.dumps(found))
    assert [config.bonus for config in go()] == ["none"]


def test_other_settings_are_not_mixed_in(go):
    go()
    with pytest.raises(SystemExit, match="other settings"):
        go("--steps", "2e6")


def test_every_reward_of_the_study_tells_progress():
    assert len(progress.tasks()) == 4
    for env in progress.tasks():
        assert len(progress.rewards(env)) == 2
        for path in progress.rewards(env):
            assert isinstance(gate.check(path.read_text(), get(env).spec), gate.Program), path
            assert 1 <= len(set(re.findall(r'"progress_\w+"', path.read_text()))) <= VALUES, path
