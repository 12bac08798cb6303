"""`eureka robust` and `openeureka.robust` on a run that fakes made: what they print, write and refuse."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from report.scripted import search_in
from tensorboard.backend.event_processing.event_file_loader import EventFileLoader

import openeureka
from openeureka.cli.show import show
from openeureka.cli.train import robust
from openeureka.config import RobustConfig, RunConfig
from openeureka.errors import ConfigError, EurekaError, Interrupted, ModelError, StoreError
from openeureka.parsing import parse
from openeureka.report import tensorboard
from openeureka.runs import compose
from openeureka.store import Store
from openeureka.testing.scripted import ScriptedModel, ToyTrainer, reply

TABLE = "```yaml\nmass: [{}, {}]\n```\n"


@pytest.fixture(autouse=True)
def trainer(monkeypatch: pytest.MonkeyPatch) -> ToyTrainer:
    toy = ToyTrainer()
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: toy)
    return toy


@pytest.fixture
def searched(tmp_path: Path) -> Path:
    return search_in(tmp_path / "run", [reply(7), reply(8)], env="cartpole", video="none")


def kill(trainer: ToyTrainer, monkeypatch: pytest.MonkeyPatch, after: int) -> None:
    """Make the trainer raise Ctrl-C after this many more lanes."""
    whole, before = trainer.result, len(trainer.trained)

    def result(lane):
        if len(trainer.trained) > before + after:
            raise KeyboardInterrupt
        return whole(lane)

    monkeypatch.setattr(trainer, "result", result)


def test_a_stopped_command_says_itself_how_to_go_on(searched, trainer, monkeypatch):
    with monkeypatch.context() as once, pytest.raises(Interrupted) as stop:
        kill(trainer, once, after=1)
        robust([str(searched), "model=random", "sample=2"])
    assert str(stop.value).endswith(f"Continue with: eureka robust {searched} model=random sample=2")


def test_a_tracker_gets_its_curves_as_it_got_those_of_the_search(tmp_path):
    run = search_in(tmp_path / "run", [reply(7), reply(8)], env="cartpole", video="none", log="tensorboard")
    assert not (run / tensorboard.EVENTS).exists()
    openeureka.robust(run, model="random", sample=1)
    events = EventFileLoader(str(run / tensorboard.EVENTS)).Load()
    told = {value.tag.rpartition("/")[0] for event in events for value in event.summary.value}
    with Store.view(run) as store:
        trained = {name for name, lane in store.lanes.all().items() if lane.role == "robust"}
    assert trained and trained <= told


def test_from_python_it_names_the_call(searched, trainer, monkeypatch, capsys):
    with monkeypatch.context() as once:
        kill(trainer, once, after=1)
        openeureka.robust(searched, model="random", sample=2)
        assert f"Continue with: openeureka.robust('{searched}', sample=2, model='random')\n" in capsys.readouterr().out
        openeureka.robust(searched, model=ScriptedModel([]), sample=2)
        assert f"Continue with: openeureka.robust('{searched}', sample=2, model=...)\n" in capsys.readouterr().out


def test_from_python_it_leaves_the_report(searched, capsys):
    run = openeureka.robust(searched, model=ScriptedModel([TABLE.format(0.9, 1.1)]), sample=1)
    assert run.robust is not None and run.robust.ours == "r0"
    assert "r0, chosen" in run.report.read_text() and capsys.readouterr().out == ""


@pytest.mark.parametrize(("settings", "replies"), [({"repair": 0}, 1), ({"repair": 1}, 2), ({}, 3)])
def test_so_many_repairs_as_are_given_and_two_otherwise(searched, settings, replies):
    model = ScriptedModel(["No table."] * 9)
    with pytest.raises(ModelError, match="No reply contains usable ranges"):
        openeureka.robust(searched, model=model, sample=1, **settings)
    assert model.said == replies


def test_the_runs_limit_of_cost_holds_unless_another_is_given(tmp_path):
    model = ScriptedModel([TABLE.format(0.9, 1.1)], name="gpt-5")
    run = search_in(tmp_path / "run", [reply(7), reply(8)], env="cartpole", video="none", max_cost=0.02)
    with pytest.raises(EurekaError, match="max_cost"):  # the search's two replies took all of it
        openeureka.robust(run, model=model, sample=1, price="1,1")
    with pytest.raises(ConfigError, match="The price of mine is not known"):
        openeureka.robust(run, model=ScriptedModel([], name="mine"), sample=1)
    assert openeureka.robust(run, model=model, sample=1, price="1,1", max_cost=0).robust is not None
    assert parse(RobustConfig, ["max_cost=0"]).applied_to(RunConfig(max_cost=5), ["max_cost"]).max_cost == 0
    assert RobustConfig(max_cost=2).applied_to(RunConfig(max_cost=5), ["max_cost"]).max_cost == 2
    assert RobustConfig().applied_to(RunConfig(max_cost=5, steps=7)).max_cost == 5


def test_what_was_begun_with_other_steps_does_not_go_on_with_these(searched, trainer, monkeypatch):
    with monkeypatch.context() as once, pytest.raises(Interrupted):
        kill(trainer, once, after=1)
        robust([str(searched), "model=random", "sample=2", "steps=1e6"])
    trained = len(trainer.trained)
    wanted = r"train with start=best steps=1000000; add both to continue them\.$"
    for words in ([], ["steps=5e5"], ["steps=1e6", "start=scratch"]):
        with pytest.raises(ConfigError, match=wanted):
            robust([str(searched), "model=random", "sample=2", *words])
    assert len(trainer.trained) == trained
    assert openeureka.robust(searched, model="random", sample=2, steps=1e6).robust is not None


def test_what_was_begun_with_the_usual_steps_takes_no_others(searched):
    openeureka.robust(searched, model="random", sample=1)
    with pytest.raises(ConfigError, match=r"train with start=best steps=\d+; add both to continue them"):
        openeureka.robust(searched, model="random", sample=1, steps=9)
    assert openeureka.robust(searched, model="random", sample=2).robust is not None


def test_what_was_begun_from_scratch_goes_on_so(searched):
    openeureka.robust(searched, model="random", sample=1, start="scratch")
    with pytest.raises(ConfigError, match="train with start=scratch steps=0; add both to continue them"):
        openeureka.robust(searched, model="random", sample=2)
    found = openeureka.robust(searched, model="random", sample=2, start="scratch", steps=0).robust
    assert found is not None and [arm.name for arm in found.arms] == ["plain", "uniform", "r0", "r1"]


def test_what_it_began_with_is_not_guessed_where_its_file_is_damaged(searched):
    openeureka.robust(searched, model="random", sample=1)
    (searched / "robust.json").write_text("{")
    with pytest.raises(StoreError):
        openeureka.robust(searched, model="random", sample=2)


@pytest.mark.parametrize("steps", [-5, 10**30])
def test_steps_that_nobody_can_mean_are_refused(searched, steps):
    with pytest.raises(ConfigError, match="`steps` must be from 0"):
        openeureka.robust(searched, model="random", steps=steps)


def test_programs_read_it_too(searched, capsys):
    openeureka.robust(searched, model="random", sample=1)
    show(searched, as_json=True)
    told = json.loads(capsys.readouterr().out)["robust"]
    assert told["ours"] == "r0" and [*told["arms"]] == ["plain", "longer", "uniform", "r0"]
    assert told["arms"]["longer"]["ranges"] == {} and told["arms"]["r0"]["hard"] is not None


def test_they_begin_with_one_of_two_things(searched):
    with pytest.raises(ConfigError, match="`start` must be best or scratch, not `here`"):
        robust([str(searched), "model=random", "start=here"])


def test_a_run_from_elsewhere_is_refused_with_the_argument_that_agrees(tmp_path):
    run = search_in(tmp_path / "run", [reply(7), reply(8)], env="cartpole", video="none", base_url="http://127.0.0.1:9")
    with pytest.raises(
        ConfigError, match=r"base_url=http://127.0.0.1:9. If you know .*, call robust\(..., trust=True\)\."
    ):
        openeureka.robust(run)
    found = openeureka.robust(run, model=ScriptedModel([TABLE.format(0.9, 1.1)]), sample=1, trust=True).robust
    assert found is not None and found.ours == "r0"


def test_the_command_writes_its_report_once(searched, monkeypatch, capsys):
    written, build = [], compose.build

    def counted(directory, *options):
        written.append(directory)
        return build(directory, *options)

    monkeypatch.setattr(compose, "build", counted)
    robust([str(searched), "model=random", "sample=1"])
    assert written == [searched] and "r0, chosen" in (searched / "report.html").read_text()
    assert "begin with report.html" in capsys.readouterr().out
