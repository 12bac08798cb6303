"""Trainings of one recipe share a row, and known trainings are neither repeated nor given a new date."""

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import choosing
import ledger
import prompts
import pytest
import rungs

from openeureka import open_run
from openeureka.config import TrainConfig
from openeureka.testing.scripted import ToyTrainer
from openeureka.types import LaneSpec

RECORD = {"played": [0.0, 0.0, 0.0, 0.0, 0.0, 2.0], "window": [], "cpu_s": 1.0}


@pytest.fixture
def trained(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """Lists the lanes that rungs.py trains. They train at once, and each plays 2 at its end."""
    lanes: list[str] = []

    def at_once(env: str, parts: Iterable[Sequence[LaneSpec]], steps: int, recipe: Any, keep: Any):
        for part in parts:
            lanes.extend(spec.id for spec in part)
            keep({spec.id: RECORD for spec in part})

    monkeypatch.setattr(rungs, "side_by_side", at_once)
    for script in (rungs, prompts, choosing):
        monkeypatch.setattr(script, "RESULTS", tmp_path / f"{script.__name__}.json")
    return lanes


def told(path: Path) -> Any:
    return json.loads(path.read_text())


def test_a_run_that_a_script_trained_in_is_finished(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: ToyTrainer())
    ledger.learn(TrainConfig(env="cartpole", reward="human", dir=str(tmp_path / "run")), ("fitness",))
    assert open_run(tmp_path / "run").finished


# --- rungs -----------------------------------------------------------------------------------------------------------


def measure(seeds: Sequence[int], **recipe: float) -> None:
    rungs.measure("ant", {"human": "human"}, seeds, recipe, 1000)


def test_where_no_lane_is_missing_there_is_no_part():
    assert list(rungs.missing({"human": "human"}, [0], {"human-s0": {}})) == []
    assert list(rungs.missing({}, [0], {})) == []


def test_a_row_says_how_its_actions_begin_whether_the_task_does_so_or_the_caller(trained: list[str]):
    measure([0], worlds=64)
    measure([0, 1], worlds=64, noise=0.4, head=0.01)  # the values of Ant's own recipe
    measure([0], worlds=64, noise=1.0, head=1.0)
    assert trained == ["human-s0", "human-s1", "human-s0"]
    calm, published = told(rungs.RESULTS)["ant"].items()
    assert calm[0] == "64 x 16, noise 0.4, head 0.01, 1,000 steps" and published[0] == "64 x 16, 1,000 steps"
    assert calm[1]["recipe"] == ledger.whole("ant", worlds=64, env_steps=1000)
    assert calm[1]["lanes"]["human-s1"]["trained"]["versions"]


def test_a_row_of_another_recipe_is_refused(trained: list[str]):
    measure([0])
    known = told(rungs.RESULTS)
    (row,) = known["ant"].values()
    row["recipe"]["gamma"] = 0.5
    rungs.RESULTS.write_text(json.dumps(known))
    with pytest.raises(SystemExit, match="ant, 512 x 16, .* with another gamma"):
        measure([1])
    assert trained == ["human-s0"] and told(rungs.RESULTS) == known


def test_what_an_older_recipe_says_nothing_of_was_the_default():
    wanted = ledger.whole("anymal")
    assert ledger.differing({word: value for word, value in wanted.items() if word != "noise"}, wanted) == []
    calm = ledger.whole("ant")
    assert ledger.differing({word: value for word, value in calm.items() if word != "noise"}, calm) == ["noise"]


def test_names_of_the_rows_that_are_shown_say_what_their_recipes_do():
    for rows in json.loads((rungs.FOLDER / "results" / "rungs.json").read_text()).values():
        for name, row in rows.items():
            for word in ("noise", "head"):
                value = row["recipe"][word]
                assert (f"{word} {value:g}," in name) if value != 1.0 else word not in name
            assert name.startswith(f"{row['recipe']['worlds']} x {row['recipe']['horizon']}, ")


# --- prompts ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def replies(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, trained: list[str]) -> list[str]:
    """Stores two replies for each advice. Lists the lanes that are trained."""
    (tmp_path / "ant.json").write_text(json.dumps({"replies": {"small": ["a", "b"], "a tenth": ["c", "d"]}}))
    monkeypatch.setattr(prompts, "REPLIES", tmp_path)
    monkeypatch.setattr(rungs, "accepted", lambda env, texts: dict.fromkeys(texts, "human"))
    return trained


def stale(lane: str) -> None:
    found = told(prompts.RESULTS)
    found["ant"]["lanes"][lane] = {"fitness": 1.0, "trained": {"recipe": {**prompts.recipe("ant"), "head": 1.0}}}
    prompts.RESULTS.write_text(json.dumps(found))


def test_what_another_recipe_trained_trains_again_and_is_told_apart_until_then(replies: list[str]):
    prompts.measure("ant", 0)
    assert sorted(replies) == ["a-s0", "b-s0", "c-s0", "d-s0", "human-s0"]
    stale("c-s0")
    before = told(prompts.RESULTS)["ant"]["lanes"]
    assert [row[3] for row in prompts.rows(told(prompts.RESULTS))] == ["2", "2, 1 with an older recipe"]
    assert next(prompts.left(told(prompts.RESULTS))) == ("ant", 0)
    replies.clear()
    prompts.measure("ant", 0)
    after = told(prompts.RESULTS)["ant"]["lanes"]
    assert replies == ["c-s0"] and after["c-s0"]["trained"]["recipe"] == prompts.recipe("ant")
    assert {lane for lane in after if after[lane] != before[lane]} == {"c-s0"}
    assert [row[3] for row in prompts.rows(told(prompts.RESULTS))] == ["2", "2"]


def test_a_seed_is_left_until_each_of_its_lanes_is_there(replies: list[str]):
    prompts.measure("ant", 0)
    found = told(prompts.RESULTS)
    assert ("ant", 0) not in list(prompts.left(found))
    del found["ant"]["lanes"]["d-s0"]
    assert ("ant", 0) in list(prompts.left(found))


# --- choosing --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Lanes:
    """A fake of a run's lanes: trains at once, and lists the lanes that it was asked for."""

    asked: list[str]
    peaks: Any = ()
    store: Any = field(
        default_factory=lambda: SimpleNamespace(lanes=SimpleNamespace(policy=no_policy, plays=dict), end=lambda: None)
    )
    trainer: Any = field(default_factory=lambda: SimpleNamespace(evaluate=lambda env, policies, seed: ()))

    def train(self, wanted: Iterable[Any]) -> Mapping[str, Any]:
        lanes = [lane.id for lane, _ in wanted]
        self.asked.extend(lanes)
        result = SimpleNamespace(fitness=1.0, curves={"fitness": [1.0]}, env_steps=1, state="done")
        return dict.fromkeys(lanes, result)

    def play(self, results: Mapping[str, Any]) -> None:
        pass


def no_policy(lane: str, peak: str) -> None:
    return None


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch, trained: list[str]) -> list[str]:
    lanes = Lanes([])

    @contextmanager
    def at_once(*_: Any):
        yield lanes

    monkeypatch.setattr(choosing, "comparing", at_once)
    monkeypatch.setattr(choosing, "programs", lambda env, store: [("a", "human"), ("b", "human")])
    return lanes.asked


def test_lanes_that_are_known_are_neither_trained_nor_stamped_again(asked: list[str]):
    own = {"steps": choosing.STEPS["ant"], "recipe": ledger.whole("ant", env_steps=choosing.STEPS["ant"])}
    known = {"ant": {**own, "lanes": {"a-s0": {"training": 5.0, "trained": {"date": "2020-01-01"}}}}}
    choosing.RESULTS.write_text(json.dumps(known))
    choosing.measure("ant", 0)
    found = told(choosing.RESULTS)["ant"]
    assert asked == ["b-s0"] and found["lanes"]["a-s0"] == known["ant"]["lanes"]["a-s0"]
    assert found["lanes"]["b-s0"]["trained"]["versions"] and set(found) == {"steps", "recipe", "lanes"}
    whole = choosing.RESULTS.read_text()
    choosing.measure("ant", 0)
    assert asked == ["b-s0"] and choosing.RESULTS.read_text() == whole


def test_other_steps_than_those_that_are_known_are_refused(asked: list[str], monkeypatch: pytest.MonkeyPatch):
    choosing.measure("ant", 0)
    monkeypatch.setitem(choosing.STEPS, "ant", 6000)
    with pytest.raises(SystemExit, match="ant with another env_steps"):
        choosing.measure("ant", 1)
