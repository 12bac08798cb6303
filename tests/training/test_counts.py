"""The bonus for rare progress: what the table of visits counts, and what happens to the table in a training."""

import dataclasses
import math

import pytest
import torch

from openeureka.training import population
from openeureka.training.population import Population
from openeureka.training.rewards import ProgressCounts, moments, spread
from openeureka.types import LaneSpec, Node, RewardGraph, TrainBudget, TrainingProgress, TrainingResult, TrainingState

SMALL = TrainBudget(env_steps=16 * 32 * 4, worlds=32)
PAID = dataclasses.replace(SMALL, bonus="progress")
EVERY = torch.ones(1, 4, dtype=torch.bool)


def reward(*names: str, scale: float = -1.0) -> RewardGraph:
    """scale * |pole angle|, with components |pole angle|, 100 |pole angle| and log(pole angle), NaN if negative."""
    nodes = (
        Node("input", ("pole_angle",)),
        Node("abs.default", ({"ref": 0},)),
        Node("mul.Tensor", ({"ref": 1}, scale)),
        Node("mul.Tensor", ({"ref": 1}, 100.0)),
        Node("log.default", ({"ref": 0},)),
    )
    places = {"angle": 1, "progress_fall": 1, "progress_far": 3, "progress_log": 4}
    return RewardGraph(nodes=nodes, reward=2, components=tuple((name, places[name]) for name in names))


def trained(specs: list[LaneSpec], budget: TrainBudget = PAID) -> tuple[Population, dict[str, TrainingResult]]:
    own = Population("cartpole", specs, budget, threads=1)
    return own, {x.lane: x for x in own.train() if isinstance(x, TrainingResult)}


def alike(one: TrainingResult, other: TrainingResult) -> bool:
    return dataclasses.replace(one, seconds=0.0) == dataclasses.replace(other, seconds=0.0)


def values(*rows: list[float]) -> torch.Tensor:
    """Progress values (1, 3, 4): lane, component, world. Missing rows are zeros."""
    return torch.tensor([[*rows, *[[0.0] * 4] * (3 - len(rows))]])


def test_a_bin_pays_the_inverse_root_of_its_visits():
    counts = ProgressCounts(1, torch.device("cpu"))
    # Three worlds share the bin from 0.1 to 0.2, one has progress 1: 1 / sqrt(3), and 1.
    assert counts(values([0.11, 0.15, 0.19, 1.0]), EVERY)[0].tolist() == pytest.approx([3**-0.5] * 3 + [1.0])
    # Then all four worlds are in the bin from 0.1 to 0.2: 3 + 4 visits.
    assert counts(values([0.12] * 4), EVERY)[0].tolist() == pytest.approx([7**-0.5] * 4)
    assert counts.visits.sum() == 8 and counts.visits.max() == 7


def test_values_are_binned_together_and_clamped():
    counts = ProgressCounts(1, torch.device("cpu"))
    paid = counts(values([0.0, 0.0, 0.95, 7.0], [0.0, 0.95, -3.0, 0.0]), EVERY)
    # The bins (0, 0) and (0, 9) have one visit each, (9, 0) has two.
    assert paid[0].tolist() == pytest.approx([1.0, 1.0, 2**-0.5, 2**-0.5])


def test_what_is_not_finite_or_broken_down_visits_nothing():
    counts = ProgressCounts(1, torch.device("cpu"))
    worlds = torch.tensor([[True, True, True, False]])
    assert counts(values([math.nan, math.inf, 0.5, 0.5]), worlds).tolist() == [[0.0, 0.0, 1.0, 0.0]]
    assert counts.visits.sum() == 1


def test_the_spread_is_that_of_all_rewards_so_far_and_1_where_there_is_none():
    own = torch.tensor([[1.0, 3.0], [5.0, 5.0], [0.0, 0.0], [math.nan, 1.0], [3e38, -3e38], [1e5, 1e5 + 1.0]])
    assert spread(moments(own, own)).tolist() == pytest.approx([1.0, 1.0, 1.0, 1.0, 3e38, 0.5])


def test_rare_progress_pays_in_the_spread_of_the_own_reward_and_shows_in_no_curve():
    specs = [LaneSpec(id="plain", program=reward("angle")), LaneSpec(id="counted", program=reward("progress_fall"))]
    (paid, found), (own, without) = trained(specs), trained(specs, SMALL)
    assert torch.equal(paid.rollout.reward[0], own.rollout.reward[0])
    assert float(paid.rollout.reward[1].max()) > 0.0 > float(own.rollout.reward[1].max()), "positive by the bonus"
    for name in ("reward", "component/progress_fall"):
        curve, plain = found["counted"].curves[name], without["counted"].curves[name]
        assert curve[0] == plain[0], "before the first update both have the same policy"
        assert curve[3] != plain[3]


def test_what_is_paid_grows_with_the_own_reward():
    first = dataclasses.replace(PAID, env_steps=16 * 32)  # one epoch, in which nothing is learned yet
    specs = [LaneSpec(id=str(scale), program=reward("progress_fall", scale=scale)) for scale in (-1.0, -1024.0)]
    small, large = trained(specs, first)[0].rollout.reward
    assert float(small.max()) > 0.0
    torch.testing.assert_close(large, small * 1024.0)


def test_programs_without_progress_and_the_tasks_own_rewards_train_as_ever():
    specs = [LaneSpec(id="a", program=reward("angle")), LaneSpec(id="h", program="human")]
    specs.append(LaneSpec(id="s", program="sparse", seed=1))
    counted, plain = trained(specs)[1], trained(specs, SMALL)[1]
    assert all(alike(counted[spec.id], plain[spec.id]) for spec in specs)


def test_progress_that_is_not_finite_costs_a_lane_that_pay_alone():
    specs = [LaneSpec(id="odd", program=reward("progress_log")), LaneSpec(id="b", program=reward("progress_fall"))]
    own, found = trained(specs)
    assert found["odd"].state is TrainingState.FINISHED
    assert found["odd"].curves["component/progress_log"] == (None,) * 4
    visits = own.rewards.counts.visits.sum(1)
    assert 0 < visits[0] < visits[1] == SMALL.env_steps


def test_a_killed_training_goes_on_with_its_visits(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(population, "PROGRESS_SECONDS", 0.0)
    specs = [LaneSpec(id="a", program=reward("progress_fall", "progress_far")), LaneSpec(id="h", program="human")]
    whole, results = trained(specs)
    first = Population("cartpole", specs, PAID, threads=1)
    for message in first.train():
        if isinstance(message, TrainingProgress) and message.epoch == 2:
            break
    second = Population("cartpole", specs, PAID, threads=1)
    second.resume(first.snapshot())
    ended = {x.lane: x for x in second.train() if isinstance(x, TrainingResult)}
    assert all(alike(ended[lane], results[lane]) for lane in ended)
    assert torch.equal(second.rewards.counts.visits, whole.rewards.counts.visits)


def test_a_lane_takes_its_visits_along_when_others_are_cut():
    specs = [LaneSpec(id=name, program=reward("progress_fall", scale=-n), seed=n) for n, name in ((1, "a"), (2, "b"))]
    half = {lane: x.paused for lane, x in trained(specs, dataclasses.replace(PAID, until=0.5))[1].items()}
    alone, found = trained([dataclasses.replace(specs[1], paused=half["b"])])
    whole, results = trained(specs)
    assert found["b"].curves["reward"] == pytest.approx(results["b"].curves["reward"], rel=1e-3)
    visits, same = alone.rewards.counts.visits, whole.rewards.counts.visits
    assert visits.sum() == same[1].sum() == SMALL.env_steps
    assert (visits[0] - same[1]).abs().sum() < 0.01 * SMALL.env_steps, "only rounding may move a visit to the next bin"
    fresh = trained([dataclasses.replace(specs[1], start=results["b"].last)], dataclasses.replace(PAID, env_steps=1))
    assert fresh[0].rewards.counts.visits.sum() == 16 * 32, "a lane that begins from a policy has no earlier visits"
