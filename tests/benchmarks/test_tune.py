"""The table of tunings: how numbers are spoiled, what is measured, and how much of the loss a tuning makes good."""

import argparse
import math
from dataclasses import replace
from statistics import mean

import pytest
import tune

from openeureka.reward.weights import weights
from openeureka.testing.scripted import ToyTrainer
from openeureka.types import LaneSpec, Node, RewardGraph

TEXT = "def compute_reward(x):\n    return 2.0 * x - 0.01 * x.abs() + (x > 0.5)\n"


class Sum(ToyTrainer):
    """F is the sum of all numbers in the graph."""

    def result(self, lane: LaneSpec):
        assert isinstance(lane.program, RewardGraph)
        worth = sum(arg for node in lane.program.nodes for arg in node.args if isinstance(arg, float))
        graph = RewardGraph(nodes=(Node("full", (float(worth),)),), reward=0, components=())
        return super().result(replace(lane, program=graph))


def test_numbers_are_spoiled_by_factors_and_thresholds_by_a_tenth():
    before, after = weights(TEXT), weights(tune.spoiled(TEXT, seed=3))
    logs = [math.log(own.value / first.value) for own, first in zip(after, before, strict=True)]
    assert tune.spoiled(TEXT, seed=3) == tune.spoiled(TEXT, seed=3) != tune.spoiled(TEXT, seed=4)
    assert all(0 < abs(log) <= tune.SPOILED for log in logs[:2]) and abs(logs[2]) <= tune.SPOILED / 10 + 1e-3


def held_out(before: float, after: float) -> tune.Record:
    return {"held_out": {"before": [before], "after": [after]}}


def test_the_way_back_is_counted_from_the_spoiled_numbers_to_the_human_ones():
    assert tune.way_back(held_out(10.0, 40.0), held_out(50.0, 55.0)) == pytest.approx(0.75)
    assert tune.way_back(held_out(50.0, 60.0), held_out(40.0, 41.0)) is None  # spoiling did no harm
    assert tune.way_back(held_out(10.0, 40.0), {"held_out": {}}) is None


def test_more_seeds_are_compared_with_more_seeds_of_the_human_reward():
    few = {**held_out(0.0, 0.1), "settings": {"steps": 9}, "difference": None, "numbers": []}
    more = {"seeds": [7, 8], "difference": None, **held_out(0.0, 0.3)}
    results = {"a/human/0": {**few, **held_out(0.2, 0.2)}, "a/spoiled/0": {**few, "confirmed": more}}

    def shares(steps: int) -> list[str]:
        row = {"steps": steps, "confirmed": {"human": [0.2, 0.6]}}
        return [line[-2] for line in tune.rows(results, {"a": row})]

    assert shares(9) == ["-", "50%", "75%"]  # 0.1 of 0.2 with the tuning's seeds, 0.3 of 0.4 with other seeds
    assert shares(8) == ["-", "50%", "150%"]  # human trainings of another length do not count: 0.3 of 0.2


KNOWN = tune.read(tune.RESULTS)


@pytest.mark.parametrize("name", sorted(KNOWN))
def test_an_interval_of_today_is_what_the_table_says(name: str):
    own = KNOWN[name]
    assert tune.between(own) == pytest.approx(own["difference"])
    again = own.get("confirmed")
    if again is not None:
        assert tune.fresh.between(*again["held_out"].values()) == pytest.approx(again["difference"])


def test_a_tuning_is_measured_on_cartpole(monkeypatch, tmp_path):
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: Sum())
    monkeypatch.setattr(tune, "OUTPUTS", tmp_path)
    options = argparse.Namespace(trials=5, sample=4, seeds=2, seed=0, steps=0, worlds=32, confirm=3)
    record = tune.measure("cartpole", "human", options)
    assert len(record["held_out"]["before"]) == len(record["held_out"]["after"]) == 2
    assert tune.between(record) == record["difference"] and len(record["rivals"]) == 1
    assert len(record["played"]) == 5 and len(record["numbers"]) == 6
    (row,) = tune.rows({"cartpole/human/0": record})
    assert len(row) == len(tune.TITLES)
    assert row[:4] == ["cartpole", "human", f"{record['settings']['steps']:,}", "0"] and row[-1].endswith(" of 6")
    record["confirmed"] = tune.confirm("cartpole/human/0", options)
    own = record["confirmed"]
    assert own["seeds"] == [3, 4, 5]  # the tuning trained with seeds 0 to 2
    assert len(own["held_out"]["before"]) == len(own["held_out"]["after"]) == 3
    assert own["difference"][0] == pytest.approx(mean(own["held_out"]["after"]) - mean(own["held_out"]["before"]))
    _, again = tune.rows({"cartpole/human/0": record})
    assert len(again) == len(tune.TITLES) and again[1] == "human, 3 other seeds"


def test_a_tuning_whose_run_is_elsewhere_is_not_confirmed(monkeypatch, tmp_path):
    monkeypatch.setattr(tune, "OUTPUTS", tmp_path)
    with pytest.raises(SystemExit, match=r"remove ant/human/0 from .*, and the same command without --confirm"):
        tune.confirm("ant/human/0", argparse.Namespace(confirm=9, out=tune.RESULTS))
