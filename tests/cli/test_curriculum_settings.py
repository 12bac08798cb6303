"""`curriculum=` of `eureka run` and `eureka train`, with a trainer of pure functions."""

import os
from dataclasses import replace
from pathlib import Path

import pytest
from toys import ToySandbox
from toys import eureka as run

from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.runs import compose, trainers
from openeureka.testing.scripted import ScriptedModel, ToyTrainer, reply

EASY, LAST = "cartpole+episode_length=100", "cartpole"
SETTINGS = ["env=cartpole", "model=scripted", "sample=1", "iteration=1", "seeds=1", "video=none"]


class StagedTrainer(ToyTrainer):
    """Lists task, lane and ranges of every training. While `stops` is set, the last stage raises Ctrl-C."""

    def __init__(self) -> None:
        super().__init__()
        self.stages: list[str] = []
        self.ranges: list[str] = []
        self.stops = False

    def train(self, env, lanes, budget):
        if self.stops and env == LAST:
            raise KeyboardInterrupt
        self.stages += [f"{env} {lane.id[-8:]}" for lane in lanes]
        self.ranges.append(str(budget.randomise))
        yield from super().train(env, lanes, budget)


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> StagedTrainer:
    """Replaces model, sandbox and trainer by fakes, and writes `stages.yaml` into a new working directory."""
    staged = StagedTrainer()
    monkeypatch.setattr(compose, "open_model", lambda config, held: ScriptedModel([reply(3.0)]))
    monkeypatch.setattr(compose, "Sandbox", ToySandbox)
    monkeypatch.setattr(compose, "record_states", lambda env: {})
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: staged)
    monkeypatch.chdir(tmp_path)
    Path("stages.yaml").write_text("- {set: {episode_length: 100}, steps: 2000}\n- {steps: 1000}\n")
    return staged


def test_train_takes_every_reward_through_the_stages_and_leaves_their_policies(toy: StagedTrainer, tmp_path: Path):
    assert run("train", "reward=human,sparse", "curriculum=stages.yaml", "dir=out") == 0
    assert toy.stages == [f"{env} {lane}" for env in (EASY, LAST) for lane in ("human-s0", "parse-s0")]
    lane = tmp_path / "out" / "lanes" / "human-s0"
    assert (lane / "stage1.safetensors").read_bytes() == b"10.0"
    assert (lane / "best_fitness.safetensors").read_bytes() == b"10.0"


def test_training_that_is_stopped_goes_on_with_the_stage_under_way(toy: StagedTrainer):
    words = ("train", "reward=human", "curriculum=stages.yaml", "dir=out")
    toy.stops = True
    assert run(*words) == 130
    toy.stops = False
    assert run(*words) == 0
    assert toy.stages == [f"{EASY} human-s0", f"{LAST} human-s0"]


def test_a_search_that_is_resumed_elsewhere_goes_on_with_the_stage_under_way(
    toy: StagedTrainer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    toy.stops = True
    assert run("run", *SETTINGS, "curriculum=stages.yaml", "dir=out") == 130
    assert len(toy.stages) == 3 and all(stage.startswith(EASY) for stage in toy.stages)
    toy.stops, begun = False, list(toy.stages)
    toy.stages.clear()
    os.mkdir("elsewhere")
    monkeypatch.chdir("elsewhere")
    assert run("resume", str(tmp_path / "out")) == 0
    # The last stage of the search (candidate, human and sparse), then both stages of the final trainings.
    assert toy.stages[:3] == [stage.replace(EASY, LAST) for stage in begun]
    assert [stage.split()[0] for stage in toy.stages[3:]] == [EASY] * 2 + [LAST] * 2  # the best and the human reward


def test_ranges_reach_every_stage_also_when_a_run_is_resumed_elsewhere(
    toy: StagedTrainer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    Path("ranges.yaml").write_text("mass: [0.8, 1.2]\n")
    toy.stops = True
    assert run("train", "reward=human", "curriculum=stages.yaml", "randomise=ranges.yaml", "dir=out") == 130
    toy.stops = False
    os.mkdir("elsewhere")
    monkeypatch.chdir("elsewhere")
    assert run("resume", str(tmp_path / "out")) == 0
    assert toy.ranges == ["mass 0.8 to 1.2 factor"] * 2


@pytest.mark.parametrize(
    ("words", "name", "before", "after"),
    [
        (["run", *SETTINGS], "randomise", "mass: [0.8, 1.2]\n", "mass: [0.5, 1.5]\n"),
        (["train", "reward=human"], "curriculum", "- {steps: 900}\n- {steps: 100}\n", "- {steps: 90}\n- {steps: 10}\n"),
    ],
)
def test_a_run_that_goes_on_holds_to_what_its_files_said(
    toy: StagedTrainer, capsys: pytest.CaptureFixture[str], words: list[str], name: str, before: str, after: str
):
    file = Path("file.yaml")
    file.write_text(before)
    toy.stops = True
    assert run(*words, f"{name}=file.yaml", "dir=out") == 130
    toy.stops = False
    file.write_text(after)
    assert run("resume", "out") == 2
    assert f"has changed since the run began. Copy out/{name}.yaml over it, or" in capsys.readouterr().err
    file.write_text(f"# a word to the reader\n{before}")
    assert run("resume", "out") == 0
    assert Path("out", f"{name}.yaml").read_text() == before


@pytest.mark.parametrize("copy", ["mass: 2001-99-99\n", "mass: !!bool x\n", 'mass: "\\UFFFFFFFF"\n', "\x00"])
def test_a_copy_that_is_damaged_is_another_one(toy: StagedTrainer, capsys: pytest.CaptureFixture[str], copy: str):
    Path("file.yaml").write_text("mass: [0.8, 1.2]\n")
    toy.stops = True
    assert run("run", *SETTINGS, "randomise=file.yaml", "dir=out") == 130
    Path("out", "randomise.yaml").write_text(copy)
    assert run("resume", "out") == 2
    assert "has changed since the run began" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["randomise=wild"], "There are no ranges `wild`. Did you mean `wide`?"),
        (["randomise=mild", "baselines=known"], "cartpole with randomise= were not measured beforehand"),
        (["curriculum=pen_spinning"], "`cartpole` has no curriculum `pen_spinning`."),
        (["curriculum=stages.yaml", "baselines=known"], "cartpole with a curriculum were not measured beforehand"),
    ],
)
def test_what_does_not_fit_is_said_before_a_model_is_asked(toy: StagedTrainer, capsys, words: list[str], sentence: str):
    assert run("run", *SETTINGS, *words, "dir=out") == 2
    assert sentence in capsys.readouterr().err
    assert toy.stages == []


def test_stages_of_which_a_policy_would_not_see_the_same_are_refused(tmp_path: Path):
    (tmp_path / "other.py").write_text(
        "from openeureka.suite.isaac.anymal import Anymal\n\nclass Sighted(Anymal):\n    unmeasured = ()\n"
    )
    (tmp_path / "stages.yaml").write_text("- {env: 'other.py:Sighted'}\n- {}\n")
    config = RunConfig(env="anymal", curriculum=str(tmp_path / "stages.yaml"))
    trainers.trainer_of(config, tmp_path)
    with pytest.raises(ConfigError, match="differ in what is measurable. Leave observe=measurable out"):
        trainers.trainer_of(replace(config, observe="measurable"), tmp_path)
