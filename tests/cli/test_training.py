import json
import re
from dataclasses import replace
from html import unescape

import pytest

from openeureka.cli.facts import facts
from openeureka.cli.main import main
from openeureka.cli.show import show
from openeureka.cli.train import resume, train
from openeureka.config import RunConfig, TrainConfig
from openeureka.errors import ConfigError, Interrupted, RewardFileError, StoreError, WorkerError
from openeureka.method import baselines
from openeureka.method.baselines import Baselines
from openeureka.report.verdict import verdict
from openeureka.report.view import RunView
from openeureka.runs.rewards import listed, named
from openeureka.score import SeedScores
from openeureka.stats import mean
from openeureka.store import Store
from openeureka.testing.scripted import ToyTrainer
from openeureka.types import Lane, LaneSpec, Node, RewardGraph, TrainingResult, TrainingState
from openeureka.ui import folder, pages

GOOD = "def compute_reward(pole_angle):\n    upright = torch.exp(-pole_angle**2)\n    return upright, {}\n"


@pytest.fixture
def toy(monkeypatch: pytest.MonkeyPatch) -> ToyTrainer:
    """A trainer with which F is 10 (human) or 5 (sparse) plus seed / 100, and one less when held out."""
    trainer = ToyTrainer()
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: trainer)
    return trainer


def test_every_reward_and_seed_is_a_lane_of_one_population(toy, tmp_path, capsys):
    train(["env=cartpole", "reward=human,sparse", "seeds=2", f"dir={tmp_path}/out"])
    assert toy.trained == ["human-s0", "human-s1", "sparse-s0", "sparse-s1"]
    rows = [line.split("  ") for line in capsys.readouterr().out.splitlines()]
    cells = {row[0]: [cell.strip() for cell in row if cell.strip()] for row in rows}
    # 10.00 and 10.01: mean 10.005 shown to two digits of the sample deviation, 0.0071
    assert cells["human"][1:3] == ["10.0050 ± 0.0071", "9.0050 ± 0.0071"]
    assert cells["sparse"][1:3] == ["5.0050 ± 0.0071", "4.0050 ± 0.0071"]


KNOWN = Baselines(
    human=SeedScores(training=(9.0,), held_out=(10.0, 12.0)),
    sparse=SeedScores(training=(5.0,), held_out=(6.0, 8.0)),
    env_steps=1000, worlds=8, device="2 cores", date="2026-01-01",
)  # fmt: skip

LEVEL = replace(KNOWN, human=KNOWN.sparse)


@pytest.mark.parametrize(
    ("rewards", "known", "score", "note"),
    [
        ("human,sparse", KNOWN, "1", "held out.\n"),  # (9 - 4) / |9 - 4|: baselines trained here come first
        ("human", KNOWN, "0.5", "1,000 steps in 8 worlds, 1 seed, on 2 cores"),  # (9 - 7) / |11 - 7|
        ("human", None, "-", "add human and sparse to reward="),
        (
            "human",
            LEVEL,
            "-",
            "No score: the human and the sparse reward both reach F 7 held out, so there is no scale. "
            "The human and the sparse reward were measured beforehand: 1,000 steps",
        ),
    ],
)
def test_scores_are_normalised_by_human_and_sparse(toy, tmp_path, capsys, monkeypatch, rewards, known, score, note):
    monkeypatch.setattr(baselines, "known", lambda env, *, played: known)
    train([f"reward={rewards}", f"dir={tmp_path}/out"])
    text = capsys.readouterr().out
    (row,) = [line for line in text.splitlines() if line.startswith("human ")]
    assert row.split()[-1] == score
    assert note in text


def test_baselines_of_other_worlds_are_no_scale(toy, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(baselines, "known", lambda env, *, played: KNOWN)
    train(["reward=human", "randomise=mild", f"dir={tmp_path}/out"])
    assert "It needs both: add human and sparse to reward=." in capsys.readouterr().out


def test_it_leaves_a_run(toy, tmp_path):
    train(["env=cartpole", "reward=human", f"dir={tmp_path}/out"])
    run = RunView.read(tmp_path / "out")
    assert not run.searched and run.lanes == {"human-s0": Lane("human", 0, "given")}
    assert run.results["human-s0"].fitness == 10.0
    assert run.evaluations["human-s0"].fitness == 9.0
    assert (tmp_path / "out" / "lanes" / "human-s0" / "best_fitness.safetensors").read_bytes() == b"10.0"
    assert (tmp_path / "out" / "lanes" / "human-s0" / "events.out.tfevents.0").is_file()


def test_scores_are_json_for_programs_and_nothing_else_is_printed(toy, tmp_path, capsys):
    train(["env=cartpole", "reward=human", f"dir={tmp_path}/out"], as_json=True)
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert found.pop("directory") == f"{tmp_path}/out"
    assert found == json.loads(json.dumps(facts(RunView.read(tmp_path / "out"))))
    assert found["given"]["human-s0"]["held_out_fitness"] == 9.0
    assert "begin with report.html" in printed.err


def test_what_could_be_trained_is_json_also_where_something_could_not(toy, tmp_path, capsys, monkeypatch):
    ending(toy, TrainingState.FAILED, "sparse", monkeypatch)
    with pytest.raises(WorkerError, match="^sparse-s0 could not be trained"):
        train([f"dir={tmp_path}/out"], as_json=True)
    lanes = json.loads(capsys.readouterr().out)["given"]
    assert {name: lane["state"] for name, lane in lanes.items()} == {"human-s0": "finished", "sparse-s0": "failed"}


def test_a_report_shows_the_table_and_the_curves_of_every_training(toy, tmp_path):
    train(["env=cartpole", "reward=human,sparse", "seeds=2", f"dir={tmp_path}/out"])
    text = (tmp_path / "out" / "report.html").read_text()
    assert "10.0050 ± 0.0071" in text and "sparse-s1: finished, F 5.01" in text
    charts = [json.loads(unescape(chart)) for chart in re.findall(r'data-chart="([^"]*)"', text)]
    assert [len(chart["lines"]) for chart in charts] == [4, 1, 1, 1, 1]  # F of all, and the component of each
    assert "http" not in re.sub(r"<(style|script)>.*?</\1>", "", text, flags=re.DOTALL).replace("http-equiv", "")


def test_the_list_of_runs_shows_the_best_of_given_rewards(toy, tmp_path):
    train(["env=cartpole", "reward=sparse,human", "seeds=2", f"dir={tmp_path}/out"])
    glance, given = folder.entry("out", tmp_path / "out").glance, RunView.read(tmp_path / "out").given
    assert glance is not None
    assert glance.held_out == glance.human == mean(given["human"].held_out) > mean(given["sparse"].held_out)


def test_the_policy_of_highest_held_out_f_is_the_best(toy, tmp_path, capsys):
    train(["env=cartpole", "reward=sparse,human", "seeds=2", f"dir={tmp_path}/out"])
    assert (tmp_path / "out" / "best" / "policy.safetensors").read_bytes() == b"10.01"
    assert "is not a policy" in capsys.readouterr().out  # a toy's policy is a number; a real one becomes policy.onnx


def test_a_reward_file_is_checked_and_named_by_its_stem(tmp_path):
    (tmp_path / "mine.py").write_text(GOOD)
    rewards = named(TrainConfig(), listed(f"human,{tmp_path}/mine.py"))
    assert list(rewards) == ["human", "mine"] and rewards["human"] is None
    candidate, verdict = rewards["mine"]
    assert candidate.source == GOOD and isinstance(verdict.graph, RewardGraph)
    (tmp_path / "human.py").write_text(GOOD)
    assert list(named(TrainConfig(), listed(f"human,{tmp_path}/human.py"))) == ["human", "human_file"]


def test_a_folder_with_commas_ends_no_list(tmp_path):
    path = tmp_path / "a, b,c" / "reward.py"
    path.parent.mkdir()
    path.write_text(GOOD)
    assert listed(f"human,{path}, sparse,") == ["human", str(path), "sparse"]


def test_files_of_one_stem_are_called_by_their_folders(tmp_path):
    for name in ("a", "b c"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "reward.py").write_text(GOOD)
    both = f"{tmp_path}/a/reward.py,{tmp_path}/b c/reward.py"
    assert list(named(TrainConfig(), listed(f"human,{both}"))) == ["human", "a_reward", "b_c_reward"]
    twice = "names `a_reward` twice; give the files different names, or name it once, with seeds=2"
    with pytest.raises(ConfigError, match=twice):
        named(TrainConfig(), listed(f"{tmp_path}/a/reward.py,{tmp_path}/a/reward.py"))
    (tmp_path / "c" / "a").mkdir(parents=True)
    (tmp_path / "c" / "a" / "reward.py").write_text(GOOD)
    with pytest.raises(ConfigError, match=twice):
        named(TrainConfig(), listed(f"{tmp_path}/a/reward.py,{tmp_path}/c/a/reward.py"))


def test_two_given_rewards_that_one_seed_cannot_part_are_named_to_be_trained_again(toy, tmp_path, capsys):
    train(["env=cartpole", "reward=human,sparse", "seeds=1", "seed=4", f"dir={tmp_path}/out"])
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == "To decide what is open: eureka train env=cartpole reward=human,sparse seed=6 seeds=3"


def test_a_refused_reward_file_trains_nothing(one_sandbox, toy, tmp_path):
    (tmp_path / "bad.py").write_text("import os\n" + GOOD)
    with pytest.raises(RewardFileError, match="was refused: line 1: `os` cannot be imported"):
        train([f"reward=human,{tmp_path}/bad.py", f"dir={tmp_path}/out"])
    assert toy.trained == [] and not (tmp_path / "out").exists()


@pytest.mark.parametrize(("reward", "sentence"), [("human,human", "names `human` twice"), (",", "names nothing")])
def test_a_list_of_rewards_that_makes_no_sense_is_refused(toy, reward, sentence):
    with pytest.raises(ConfigError, match=sentence):
        train([f"reward={reward}"])


def ending(trainer: ToyTrainer, state: TrainingState, lanes: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make lanes whose ids begin with `lanes` end early."""
    whole = trainer.result

    def result(lane):
        if not lane.id.startswith(lanes):
            return whole(lane)
        return TrainingResult(
            lane=lane.id, state=state, fitness=None, curves={}, env_steps=0, seconds=0.0, message="It went wrong."
        )

    monkeypatch.setattr(trainer, "result", result)


def test_where_nothing_could_be_trained_the_reason_is_all_that_is_said(toy, tmp_path, capsys, monkeypatch):
    ending(toy, TrainingState.FAILED, "", monkeypatch)
    with pytest.raises(WorkerError, match=r"^It went wrong\.\nWhat is done is kept"):
        train([f"dir={tmp_path}/out"])
    assert "report.html" not in capsys.readouterr().out


def test_what_could_not_be_trained_is_named_after_what_could(toy, tmp_path, capsys, monkeypatch):
    ending(toy, TrainingState.FAILED, "sparse", monkeypatch)
    with pytest.raises(WorkerError, match=r"^sparse-s0 could not be trained\. It went wrong\.$"):
        train([f"dir={tmp_path}/out"])
    assert "human   10" in capsys.readouterr().out


def test_why_a_training_ended_early_is_said(toy, tmp_path, capsys, monkeypatch):
    ending(toy, TrainingState.DIVERGED, "sparse", monkeypatch)
    train([f"dir={tmp_path}/out"])
    assert "sparse-s0 It went wrong." in capsys.readouterr().out


def stopping(trainer: ToyTrainer, after: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Raise Ctrl-C once `after` lanes have trained."""
    whole = trainer.result

    def result(lane):
        if len(trainer.trained) > after:
            raise KeyboardInterrupt
        return whole(lane)

    monkeypatch.setattr(trainer, "result", result)


@pytest.mark.parametrize("again", [train, resume])
def test_a_stopped_training_goes_on_with_what_is_missing(toy, tmp_path, monkeypatch, again):
    (tmp_path / "mine.py").write_text(GOOD.replace("return upright", "return upright * 3"))
    words = ["env=cartpole", "reward=human,sparse", "seeds=2", f"dir={tmp_path}/out"]
    with monkeypatch.context() as once, pytest.raises(Interrupted, match=f"eureka resume {tmp_path}/out"):
        stopping(toy, 3, once)
        train(words)
    assert folder.entry("", tmp_path / "out").state is folder.RunState.STOPPED
    again(words if again is train else [f"{tmp_path}/out"])
    assert toy.trained == ["human-s0", "human-s1", "sparse-s0", "sparse-s1", "sparse-s1"]
    assert folder.entry("", tmp_path / "out").state is folder.RunState.FINISHED
    run = RunView.read(tmp_path / "out")
    assert {name: own.held_out for name, own in run.given.items()} == {"human": (9.0, 9.01), "sparse": (4.0, 4.01)}


def test_a_run_that_was_killed_before_it_had_its_rewards_says_what_to_type(toy, tmp_path):
    Store.open(tmp_path / "out", RunConfig(model="none", video="none")).close()
    with pytest.raises(StoreError, match="holds no rewards yet; start it again with the same `eureka train` command"):
        resume([f"{tmp_path}/out"])


def test_a_run_of_other_rewards_is_refused(toy, tmp_path):
    train(["reward=human", f"dir={tmp_path}/out"])
    with pytest.raises(StoreError, match=r"holds a run of other rewards \(human\)") as refused:
        train(["reward=human,sparse", f"dir={tmp_path}/out"])
    assert not hasattr(refused.value, "__notes__"), "no advice to resume: that would not train the other rewards"


def test_a_reward_file_is_kept_so_that_the_run_needs_it_no_more(one_sandbox, toy, tmp_path, monkeypatch):
    (tmp_path / "my reward.py").write_text(GOOD)
    monkeypatch.setattr(toy, "result", lambda lane: ToyTrainer().result(replace(lane, program="sparse")))
    train([f"reward={tmp_path}/my reward.py", f"dir={tmp_path}/out"])
    (tmp_path / "my reward.py").unlink()
    with Store.view(tmp_path / "out") as store:
        assert list(store.rewards.named()) == ["my_reward"]
    assert (tmp_path / "out" / "best" / "reward.py").read_text() == GOOD
    resume([f"{tmp_path}/out"])
    assert toy.trained == ["my_reward-s0"]


def test_a_training_is_shown_by_show_and_on_the_page(toy, tmp_path, capsys):
    train(["reward=human,sparse", "seeds=2", f"dir={tmp_path}/out"])
    capsys.readouterr()
    show(tmp_path / "out")
    verdict = "human is better than sparse: F 9.005 (2 seeds) against 4.005 (2 seeds)"
    assert verdict in capsys.readouterr().out
    run = RunView.read(tmp_path / "out")
    page = str(pages.overview(tmp_path / "out", run) | pages.now(tmp_path / "out", run))
    assert "4 of 4 trainings done" in page and verdict in page


@pytest.mark.parametrize(
    ("worth", "seeds", "says"),
    [
        # Held out, both have the F of untrained policies, -1, but for 0.01 a seed.
        (0.0, 3, "Nothing learnt: policies of no reward are shown to beat untrained ones; F -0.99 (3 seeds) against"),
        (1.0, 3, "Not decided between human and sparse: F 0.01 (3 seeds) against 0.01 (3 seeds)"),
        (0.0, 1, "Not decided between human and sparse: F -1 (1 seed) against -1 (1 seed), held out. One seed says"),
    ],
)
def test_rewards_that_taught_nothing_are_told_from_those_that_are_level(
    toy, tmp_path, capsys, monkeypatch, worth, seeds, says
):
    def result(lane: LaneSpec) -> TrainingResult:
        level = RewardGraph(nodes=(Node("full", (worth,)),), reward=0, components=())
        return ToyTrainer().result(replace(lane, program=level))

    monkeypatch.setattr(toy, "result", result)
    for _ in range(2):  # untrained policies play once, however often it is called
        train(["reward=human,sparse", "steps=1000", f"seeds={seeds}", f"dir={tmp_path}/out"])
    run = RunView.read(tmp_path / "out")
    assert verdict(run).startswith(says) and run.untrained == [-1.0] * (6 if seeds > 1 else 0)
    longer = f"eureka train env=cartpole reward=human,sparse steps=3000 seed={seeds + 1} seeds=3"
    assert (longer in capsys.readouterr().out) is says.startswith("Nothing")


def test_a_search_without_a_model_is_no_search(toy, capsys):
    with pytest.raises(SystemExit):
        main(["run", "model=none"])
    assert "use `eureka train` to train and compare given rewards" in capsys.readouterr().err
