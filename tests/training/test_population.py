import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from openeureka.suite.isaac.cartpole import Cartpole
from openeureka.tasks.env import Step
from openeureka.tasks.registry import make
from openeureka.tasks.task import Score, State
from openeureka.training import pausing, population
from openeureka.training.curves import Curves
from openeureka.training.policy import Player, Policy
from openeureka.training.population import Population
from openeureka.training.ppo import STATISTICS
from openeureka.training.rewards import correlation, moments
from openeureka.training.wire import SNAPSHOT, pack_lanes, unpack_lanes
from openeureka.types import LaneSpec, Node, RewardGraph, TrainBudget, TrainingProgress, TrainingResult, TrainingState
from openeureka.worker import Frame

SMALL = TrainBudget(env_steps=16 * 32 * 4, worlds=32)


def upright(scale: float = -1.0) -> RewardGraph:
    """scale * |pole angle|"""
    nodes = (
        Node("input", ("pole_angle",)),
        Node("abs.default", ({"ref": 0},)),
        Node("mul.Tensor", ({"ref": 1}, scale)),
    )
    return RewardGraph(nodes=nodes, reward=2, components=(("angle", 1),))


def results(specs: list[LaneSpec], budget: TrainBudget = SMALL) -> dict[str, TrainingResult]:
    torch.manual_seed(0)
    found = [x for x in Population("cartpole", specs, budget, threads=1).train() if isinstance(x, TrainingResult)]
    assert [result.lane for result in found] == [spec.id for spec in specs]
    return {result.lane: result for result in found}


def test_training_is_deterministic_and_does_not_depend_on_global_random_state():
    specs = [LaneSpec(id="a", program="human", seed=1), LaneSpec(id="b", program=upright(), seed=1)]
    first = results(specs)
    torch.manual_seed(99)
    assert dict(first["b"].curves) == dict(results(specs)["b"].curves)


def test_a_training_goes_on_from_its_saved_state_as_if_nothing_had_happened(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(population, "PROGRESS_SECONDS", 0.0)
    specs = [LaneSpec(id="human", program="human"), LaneSpec(id="own", program=upright(), seed=1)]
    whole = results(specs)
    first = Population("cartpole", specs, SMALL, threads=1)
    for message in first.train():
        assert isinstance(message, TrainingProgress)
        if message.epoch == 2:
            break
    second = Population("cartpole", specs, SMALL, threads=1)
    second.resume(first.snapshot())
    for message in second.train():
        if isinstance(message, TrainingProgress):
            assert message.epoch > 2
        else:
            assert dataclasses.replace(message, seconds=0.0) == dataclasses.replace(whole[message.lane], seconds=0.0)


def test_what_ppo_did_is_a_curve_with_a_number_for_every_update():
    found = results([LaneSpec(id="human", program="human"), LaneSpec(id="bad", program=upright(1e30))])
    curves = found["human"].curves
    assert all(value is not None for name in STATISTICS for value in curves[f"ppo/{name}"])
    # Cartpole has one normal action, at first of standard deviation 1: 0.5 + 0.5 log(2 pi) = 1.4189.
    assert curves["ppo/entropy"][0] == pytest.approx(1.4189, abs=0.01)
    assert {curves[f"ppo/{name}"] for name in STATISTICS if name.endswith("loss")}.isdisjoint({(0.0,) * 4})
    # A lane that was stopped in its first epoch had no update.
    assert [found["bad"].curves[f"ppo/{name}"] for name in STATISTICS] == [(None,)] * len(STATISTICS)


def test_the_clock_of_a_training_goes_on_after_a_pause(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(population, "PROGRESS_SECONDS", 0.0)
    now = iter(range(0, 1000))
    monkeypatch.setattr(population, "time", SimpleNamespace(monotonic=lambda: float(next(now))))
    specs = [LaneSpec(id="human", program="human")]
    first = Population("cartpole", specs, SMALL, threads=1)
    for message in first.train():
        if isinstance(message, TrainingProgress) and message.epoch == 2:
            break
    saved, before = first.snapshot(), tuple(first.clock)
    now = iter(range(5000, 6000))  # the machine was off
    second = Population("cartpole", specs, SMALL, threads=1)
    second.resume(saved)
    (result,) = [message for message in second.train() if isinstance(message, TrainingResult)]
    assert len(result.clock) == 4 and list(result.clock) == sorted(result.clock)
    assert result.clock[:2] == before and 0 < result.clock[0] < result.clock[3] <= result.seconds < 50


def test_progress_counts_the_steps_of_all_lanes(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(population, "PROGRESS_SECONDS", 0.0)
    now = iter(range(1000))
    monkeypatch.setattr(population, "time", SimpleNamespace(monotonic=lambda: float(next(now))))
    specs = [LaneSpec(id=name, program="human", seed=seed) for seed, name in enumerate("ab")]
    first = next(Population("cartpole", specs, SMALL, threads=1).train())
    # The clock is read twice an epoch, a second apart: 16 steps of 32 worlds of 2 lanes in 2 s.
    assert isinstance(first, TrainingProgress) and first.env_steps_per_second == 512.0


def test_the_first_quarter_of_the_longest_episode_counts_as_early(monkeypatch: pytest.MonkeyPatch):
    early, late = set[int](), set[int]()

    def add(self: Curves, step: Step, *others: torch.Tensor) -> None:
        mask = others[-1].bool()
        early.update(step.episode_length[mask].tolist())
        late.update(step.episode_length[~mask].tolist())
        whole(self, step, *others)

    whole = Curves.add
    monkeypatch.setattr(Curves, "add", add)
    results([LaneSpec(id="a", program=upright())])
    # Episodes begin at any step. A quarter of 500 steps is 125.
    assert 100 < max(early) <= 125 < min(late) < 150


def test_a_lane_trains_the_same_beside_others():
    spec = LaneSpec(id="a", program=upright(), seed=1)
    beside = results([LaneSpec(id="x", program="human", seed=2), spec])["a"].curves["reward"]
    assert results([spec])["a"].curves["reward"] == pytest.approx(beside, rel=1e-3)


def test_a_success_bonus_trains_generated_rewards_only_and_shows_in_no_curve(monkeypatch: pytest.MonkeyPatch):
    def bonus(task: Cartpole, s: State) -> torch.Tensor:
        return 250.0 * (s["pole_angle"].abs() < 0.05)

    monkeypatch.setattr(Cartpole, "success_bonus", bonus)
    specs = [LaneSpec(id="own", program=upright()), LaneSpec(id="human", program="human")]
    trained: dict[str, Population] = {}
    for switch in ("none", "original"):
        trained[switch] = Population("cartpole", specs, dataclasses.replace(SMALL, bonus=switch), threads=1)
        list(trained[switch].train())
    without, with_bonus = (trained[switch].rollout.reward for switch in ("none", "original"))
    # a bonus of 250 and a negative reward, scaled by 0.1
    assert float(without[0].max()) < 0.0 and float(with_bonus[0].max()) == pytest.approx(25.0, abs=0.01)
    torch.testing.assert_close(with_bonus[1], without[1], atol=1e-3, rtol=1e-3)
    # Before the first update both trained the same policy, and its reward is recorded without the bonus.
    assert trained["original"].curves.curves[0]["reward"][0] == trained["none"].curves.curves[0]["reward"][0]
    assert trained["original"].curves.curves[0]["reward"][3] != trained["none"].curves.curves[0]["reward"][3]


def test_a_task_without_a_bonus_trains_as_ever():
    specs = [LaneSpec(id="a", program=upright())]
    assert results(specs, dataclasses.replace(SMALL, bonus="original"))["a"].curves == results(specs)["a"].curves


def test_curves_hold_one_point_an_epoch_and_every_component():
    result = results([LaneSpec(id="a", program=upright(-2.0))])["a"]
    curves = result.curves
    whole = {"fitness", "episode_length", "reward", "human_reward", "component/angle"}
    whole |= {f"ppo/{name}" for name in STATISTICS}
    assert set(curves) == whole | {"component_early/angle", "component_late/angle"}
    assert {len(curves[name]) for name in whole} == {4}
    assert curves["reward"] == pytest.approx([-2.0 * (x or 0.0) for x in curves["component/angle"]], rel=1e-4)
    assert all(float(f"{x:.6g}") == x for x in curves["component/angle"] if x is not None)
    assert result.fitness == max(x for x in curves["fitness"] if x is not None)


def test_a_lane_whose_reward_is_absurd_is_masked_and_the_others_are_bit_identical():
    good = LaneSpec(id="good", program=upright())
    calm = results([good, LaneSpec(id="bad", program=upright())])["good"]
    found = results([good, LaneSpec(id="bad", program=upright(1e30))])
    assert found["bad"].state is TrainingState.DIVERGED
    assert "not finite or beyond 1e6" in found["bad"].message
    assert found["good"].state is TrainingState.FINISHED
    # It was stopped in the first of four epochs of 16 steps of 32 worlds.
    assert (found["bad"].env_steps, found["good"].env_steps) == (16 * 32, 4 * 16 * 32)
    assert {len(curve) for curve in found["bad"].curves.values()} == {1}
    assert found["bad"].correlation is None  # its worlds went on for three epochs more
    assert dict(found["good"].curves) == dict(calm.curves)
    assert found["good"].best_fitness is not None and calm.best_fitness is not None
    assert found["good"].best_fitness.policy == calm.best_fitness.policy


def test_the_human_reward_balances_the_pole_within_a_hundred_thousand_steps():
    specs = [LaneSpec(id=str(seed), program="human", seed=seed) for seed in range(3)]
    found = results(specs, TrainBudget(env_steps=100_000, worlds=64))
    # Two of the three balance the pole for all 500 steps after half of the training, which leaves room for rounding.
    # Untrained, the pole falls within 50 steps.
    assert sorted(result.fitness or 0.0 for result in found.values())[1] > 400


def test_a_lane_whose_policy_is_not_finite_is_masked_and_the_others_are_bit_identical():
    specs = [LaneSpec(id="good", program=upright()), LaneSpec(id="bad", program="human", seed=1)]
    calm = results(specs)["good"]
    population = Population("cartpole", specs, SMALL, threads=1)
    population.ppo.network.flat[1] = float("nan")
    good, bad = (x for x in population.train() if isinstance(x, TrainingResult))
    assert bad.state is TrainingState.DIVERGED and "policy was not finite" in bad.message
    assert dict(good.curves) == dict(calm.curves)


@pytest.mark.parametrize("masked", [False, True])
def test_an_observation_that_is_no_number_where_an_episode_ended_is_worth_nothing(masked: bool):
    alone = Population("cartpole", [LaneSpec(id="human", program="human")], SMALL, threads=1)
    alone.env.masked = masked  # as on a GPU
    step = alone.env.step(torch.zeros(32, 1))
    step.final_observation[0], step.timed_out[1] = torch.nan, True
    worth = alone._beyond(step)[0]
    assert worth.isfinite().all() and worth[1] != 0.0 and worth.count_nonzero() == 1


@pytest.mark.parametrize("masked", [False, True])
def test_a_time_out_is_worth_what_its_last_state_is_and_not_the_one_after_the_reset(masked: bool):
    alone = Population("cartpole", [LaneSpec(id="human", program="human")], SMALL, threads=1)
    alone.env.masked = masked  # as on a GPU
    step = alone.env.step(torch.zeros(32, 1))
    step = step._replace(final_observation=step.observation + 1.0)
    step.timed_out[3] = True
    last, after = (alone.ppo.value(seen[None])[0, 3] for seen in (step.final_observation, step.observation))
    torch.testing.assert_close(alone._beyond(step)[0, 3], last)
    assert abs(last - after) > 1e-3


def test_what_follows_a_time_out_is_discounted_by_a_step(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Population, "_beyond", lambda self, step: torch.full((1, 32), 10.0))
    alone = Population("cartpole", [LaneSpec(id="a", program=upright(0.0))], SMALL, threads=1)
    list(alone.train())
    # A reward of 0 and a value of 10, a step later: 0.99 * 10.
    torch.testing.assert_close(alone.rollout.reward, torch.full_like(alone.rollout.reward, 9.9))


def test_training_ends_when_every_lane_has_diverged():
    specs = [LaneSpec(id=name, program=upright(1e30)) for name in "ab"]
    found = results(specs, TrainBudget(env_steps=10**12, worlds=32))
    assert {result.state for result in found.values()} == {TrainingState.DIVERGED}
    assert {result.env_steps for result in found.values()} == {16 * 32}


def test_a_policy_survives_being_stored():
    result = results([LaneSpec(id="a", program="human", seed=1), LaneSpec(id="b", program="human", seed=2)])
    data = [r.best_fitness.policy for r in result.values() if r.best_fitness]
    policies = [Policy.from_bytes(part) for part in data]
    assert [policy.to_bytes() for policy in policies] == data
    observation = torch.randn(10, 4)
    together = Player(policies)(observation)
    apart = torch.cat([Player([policy])(part) for policy, part in zip(policies, observation.split(5), strict=True)])
    torch.testing.assert_close(together, apart)


def test_noise_of_play_is_that_of_training_the_same_for_every_lane_and_repeats():
    (result,) = results([LaneSpec(id="a", program="human", seed=1)]).values()
    assert result.best_fitness is not None
    policy = Policy.from_bytes(result.best_fitness.policy)
    observation = torch.zeros(2 * 4000, 4)
    quiet, noisy = Player([policy] * 2)(observation), Player([policy] * 2, noise=7)(observation)
    assert torch.equal(noisy[:4000], noisy[4000:]) and not torch.equal(noisy[0], noisy[1])
    assert torch.equal(noisy, Player([policy] * 2, noise=7)(observation))
    assert not torch.equal(noisy, Player([policy] * 2, noise=8)(observation))
    std = policy.tensors["log_std"].exp().flatten()
    torch.testing.assert_close((noisy - quiet)[:4000].std(0), std, rtol=0.05, atol=0.0)


def test_episodes_that_begin_alike_differ_by_noise_alone():
    from openeureka.training.evaluate import evaluate

    (result,) = results([LaneSpec(id="a", program="human", seed=1)]).values()
    assert result.best_fitness is not None
    policies = {"a": result.best_fitness.policy}
    (quiet,), (noisy,), (again,) = (
        evaluate("cartpole", policies, seed=3, episodes=16, noise=noise) for noise in (False, True, True)
    )
    assert noisy == again and noisy.episode_length != quiet.episode_length


@pytest.mark.parametrize(("env", "alike"), [("shadow_hand_door_open_outward", True), ("cartpole", False)])
def test_policies_play_with_noise_where_all_episodes_begin_alike(env, alike, monkeypatch):
    from openeureka.training.evaluate import begin_alike, evaluate

    simulation = make(env, worlds=3, lane_seeds=[5, 5], threads=1)
    simulation.reset()
    assert begin_alike(simulation, 2) == alike
    budget = TrainBudget(worlds=2, env_steps=1)
    specs = [LaneSpec(id="a", program="human", seed=1)]
    (trained,) = (x for x in Population(env, specs, budget, threads=1).train() if isinstance(x, TrainingResult))
    policies = {"a": trained.last or b""}
    usual, quiet, noisy = (evaluate(env, policies, seed=3, episodes=3, noise=noise)[0] for noise in (None, False, True))
    assert usual == (noisy if alike else quiet) and usual.noisy == alike
    (single,) = evaluate(env, policies, seed=3, episodes=1)
    assert not single.noisy, "a single episode needs no noise"
    monkeypatch.setattr(simulation.task, "steps_itself", True)
    assert not begin_alike(simulation, 2), "equal starts may go on differently where a task steps itself"


def test_correlation_is_pearsons():
    x = torch.tensor([[1.0, 2.0, 3.0, 4.0], [1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
    y = torch.tensor([[2.0, 4.0, 5.0, 4.0], [1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0]])
    sums = moments(x, y)
    # Lane 0: means 2.5 and 3.75, covariance sum 3.5, squares 5 and 4.75: 3.5 / sqrt(23.75) = 0.71818.
    assert correlation(sums[0]) == pytest.approx(0.71818, abs=1e-5)
    assert [correlation(moments(one, other)[0]) for one, other in ((x, 1e-4 * y), (1e-4 * x, y))] == pytest.approx(
        [0.71818] * 2, abs=1e-5
    )  # in any unit
    assert correlation(sums[1]) is correlation(sums[2]) is None
    assert correlation(moments(y, x)[1]) is correlation(moments(y, x)[2]) is None


def step_of(score: Score, ended: bool) -> Step:
    """A step of two worlds in which only the score matters."""
    zero, none = torch.zeros(2), torch.zeros(2, dtype=torch.bool)
    whole = torch.full((2,), ended)
    return Step(zero, zero, {}, none, whole, score, whole, torch.full((2,), 7), none)


def test_an_epoch_without_a_finished_episode_has_no_fitness():
    curves = Curves(lanes=1, worlds=2)
    zero = torch.zeros(2)
    curves.add(step_of(Score(zero, zero), ended=False), zero.view(1, 2), zero.view(1, 2), torch.zeros(0, 2), zero)
    assert curves.close_epoch() == ([None], [0.0])
    assert curves.curves[0]["episode_length"] == [None]


def test_components_are_told_apart_early_and_late_in_episodes():
    curves = Curves(lanes=1, worlds=2, components=[(0, "a"), (0, "never")])
    score, zero = Score(torch.zeros(2), torch.zeros(2)), torch.zeros(1, 2)

    def epoch(steps, parts):
        for values, early in steps:
            value, mask = torch.tensor(values), torch.tensor(early)
            means = torch.stack((value.mean(), (value * mask).mean()))
            undefined = torch.full((2,), torch.nan)
            curves.add(step_of(score, ended=False), zero, zero, torch.stack((means, undefined)), mask)
        curves.close_epoch(parts=parts)

    epoch([([100.0, 100.0], [1.0, 0.0])], parts=False)
    assert curves.early_and_late(0) == {}
    epoch([([1.0, 2.0], [1.0, 1.0]), ([6.0, 10.0], [1.0, 0.0])], parts=True)
    # Early: (1 + 2 + 6) / 3; late: 10 / 1.
    assert curves.early_and_late(0)["component_early/a"] == (3.0,)
    assert curves.early_and_late(0)["component_late/a"] == (10.0,)
    assert curves.early_and_late(0)["component_late/never"] == (None,)
    epoch([([4.0, 4.0], [0.0, 0.0])], parts=True)
    assert curves.early_and_late(0)["component_late/a"] == (6.0,)  # (10 + 4 + 4) / 3
    again = Curves(lanes=1, worlds=2, components=curves.components)
    again.load_lanes([curves.lane_state(0)])
    assert again.early_and_late(0)["component_late/a"] == (6.0,)

    class OnGPU:
        """Stands for a tensor that was loaded onto a GPU."""

        def cpu(self):
            return curves.lane_state(0)["parts"]

    elsewhere = Curves(lanes=1, worlds=2, components=curves.components)
    elsewhere.load_lanes([{**curves.lane_state(0), "parts": OnGPU()}])
    assert elsewhere.early_and_late(0)["component_late/a"] == (6.0,)


def test_the_last_tenth_of_a_training_says_what_components_were_early_in_episodes():
    budget = TrainBudget(env_steps=32 * 16 * 20, worlds=32)
    spec = LaneSpec(id="a", program=upright())
    curves = results([spec], budget)["a"].curves
    assert [len(curves[f"component_{part}/angle"]) for part in ("early", "late")] == [1, 1]
    # Episodes last about 30 of 500 steps, so every step is early. The last tenth of 20 epochs is two epochs.
    assert curves["component_early/angle"][0] == pytest.approx(sum(curves["component/angle"][-2:]) / 2, rel=1e-4)
    assert curves["component_late/angle"] == (None,)


def test_fitness_looks_back_over_the_window_and_weighs_episodes_alike():
    curves = Curves(lanes=1, worlds=2, window=2)
    zero = torch.zeros(1, 2)
    found = []
    for values, weights in (([10.0, 20.0], [1.0, 1.0]), ([30.0, 99.0], [1.0, 0.0]), ([50.0, 70.0], [1.0, 1.0])):
        score = Score(torch.tensor(values), torch.tensor(weights))
        curves.add(step_of(score, ended=True), zero, zero, torch.zeros(0, 2), zero[0])
        found += curves.close_epoch()[0]
    # (10 + 20) / 2; (10 + 20 + 30) / 3; (30 + 50 + 70) / 3
    assert found == [15.0, 20.0, 50.0]
    assert curves.curves[0]["episode_length"] == [7.0, 7.0, 7.0]


def ended(*wins: bool, terminated: bool) -> Step:
    """A step that ends the episodes of two worlds."""
    done, none = torch.ones(2, dtype=torch.bool), torch.zeros(2, dtype=torch.bool)
    score = Score(torch.tensor(wins).float(), torch.ones(2))
    return step_of(score, ended=True)._replace(terminated=done if terminated else none, timed_out=none)


def test_fitness_waits_where_only_the_quick_episodes_can_have_ended():
    """Two quick episodes succeed, then two long ones fail: F is 2 of 4. Without a wait, F would first be 1."""
    zero, settled = torch.zeros(1, 2), {}
    for epochs in (0, 2):
        curves = Curves(lanes=1, worlds=2, window=2, settled=epochs)
        for step in (ended(True, True, terminated=True), ended(False, False, terminated=False)):
            curves.add(step, zero, zero, torch.zeros(0, 2), zero[0])
            settled.setdefault(epochs, []).extend(curves.close_epoch()[0])
    assert settled == {0: [1.0, 0.5], 2: [None, 0.5]}


def test_fitness_waits_neither_for_episodes_that_last_nor_where_it_tells_of_every_step():
    zero = torch.zeros(1, 2)
    lasting, every = ended(True, False, terminated=False), step_of(Score(torch.ones(2), torch.ones(2)), ended=False)
    every = every._replace(timed_out=torch.zeros(2, dtype=torch.bool))
    for steps, wanted in (([lasting], 0.5), ([every, ended(True, False, terminated=True)], 0.75)):
        curves = Curves(lanes=1, worlds=2, window=2, settled=4)
        for step in steps:
            curves.add(step, zero, zero, torch.zeros(0, 2), zero[0])
        assert curves.close_epoch()[0] == [wanted]


def test_fitness_of_steps_waits_until_an_episode_has_passed():
    """Each world scores 10 in its first step and 1 in the later ones."""
    zero, found = torch.zeros(1, 2), {}
    for full in (0, 2):
        curves = Curves(lanes=1, worlds=2, window=2, full=full, settled=4)
        for value in (10.0, 1.0, 1.0):
            score = Score(torch.full((2,), value), torch.ones(2))
            step = step_of(score, ended=False)._replace(timed_out=torch.zeros(2, dtype=torch.bool))
            curves.add(step, zero, zero, torch.zeros(0, 2), zero[0])
            found.setdefault(full, []).extend(curves.close_epoch()[0])
    assert found == {0: [10.0, 5.5, 1.0], 2: [None, 5.5, 1.0]}


def test_a_policy_that_learns_nothing_is_no_peak_because_all_worlds_begin_with_a_reset():
    """A quadcopter starts near its target, where F is high. An episode of 500 steps takes 16 epochs of 32 steps."""

    def train(epochs: int, until: float = 1.0, start: TrainingResult | None = None) -> TrainingResult:
        budget = TrainBudget(env_steps=16 * 32 * epochs, worlds=16, until=until)
        spec = LaneSpec(id="human", program="human", paused=start.paused if start is not None else None)
        messages = Population("quadcopter", [spec], budget, threads=1).train()
        return next(message for message in messages if isinstance(message, TrainingResult))

    whole = train(20)
    fitness = whole.curves["fitness"]
    assert fitness[:15] == (None,) * 15 and None not in fitness[15:]
    assert whole.best_fitness is not None and whole.best_fitness.epoch >= 15 and whole.fitness == max(fitness[15:])
    half = train(20, until=0.5)  # a pause is not the end of the training
    assert half.fitness is None and half.curves["fitness"] == (None,) * 10
    assert dataclasses.replace(train(20, start=half), seconds=0.0) == dataclasses.replace(whole, seconds=0.0)
    short = train(3).curves["fitness"]  # too short to wait: only the last epoch has an F
    assert short[:2] == (None, None) and short[2] is not None


LUCKY = """
import torch
from openeureka.suite.isaac.cartpole import Cartpole
from openeureka.tasks.task import mean_over_episodes

class Lucky(Cartpole):
    env = "lucky"
    episode_length, time_out_early, counts_early = 64, 0, False
    memory = ("lucky",)

    def __init__(self, *args):
        super().__init__(*args)
        self.lucky = torch.zeros(self.num_envs, dtype=torch.bool)

    def reset(self, worlds):
        super().reset(worlds)
        self.lucky[worlds] = self.noise.uniform(worlds, 1)[:, 0] < 1 / 8

    def terminated(self, s):
        return self.lucky & (self.progress > 2)

    def fitness(self, s, ended):
        return mean_over_episodes(self.lucky, ended)
"""


def test_a_policy_that_seldom_succeeds_is_no_peak_because_its_successes_come_first(tmp_path: Path):
    """One episode in eight succeeds, at once, whatever the policy does. The others take 64 steps: four epochs."""
    (tmp_path / "lucky.py").write_text(LUCKY)

    def train(epochs: int, until: float = 1.0) -> TrainingResult:
        budget = TrainBudget(env_steps=256 * 16 * epochs, worlds=256, until=until)
        spec = LaneSpec(id="human", program="human")
        messages = Population(f"{tmp_path}/lucky.py", [spec], budget, threads=1).train()
        return next(message for message in messages if isinstance(message, TrainingResult))

    found = train(12)
    assert found.curves["fitness"][:7] == (None,) * 7 and None not in found.curves["fitness"][7:]
    assert found.best_fitness is not None and found.best_fitness.epoch >= 7
    assert found.fitness == pytest.approx(1 / 8, abs=0.05)
    short = train(3).curves["fitness"]  # too short to wait: only the last epoch has an F
    assert short[:2] == (None, None) and short[2] is not None
    assert train(12, until=0.25).fitness is None


def paused(specs: list[LaneSpec], until: int) -> dict[str, TrainingResult]:
    budget = dataclasses.replace(SMALL, until=until / 4)
    found = {
        x.lane: x for x in Population("cartpole", specs, budget, threads=1).train() if isinstance(x, TrainingResult)
    }
    assert {result.state for result in found.values()} == {TrainingState.PAUSED}
    return found


def test_lanes_that_paused_go_on_as_if_nothing_had_happened():
    specs = [LaneSpec(id="human", program="human"), LaneSpec(id="own", program=upright(), seed=1)]
    first = paused(specs, until=1)
    assert {(result.env_steps, len(result.curves["fitness"])) for result in first.values()} == {(16 * 32, 1)}
    again = [dataclasses.replace(spec, paused=first[spec.id].paused) for spec in specs]
    second = paused(again, until=3)
    last = results([dataclasses.replace(spec, paused=second[spec.id].paused) for spec in specs])
    whole = results(specs)
    for lane, result in last.items():
        # `component_early` and `_late` are of the last tenth of the last part: the last epoch, as without pauses.
        assert dataclasses.replace(result, seconds=0.0) == dataclasses.replace(whole[lane], seconds=0.0)


def test_a_lane_that_was_stopped_after_its_pause_goes_on_as_if_nothing_had_happened(monkeypatch: pytest.MonkeyPatch):
    """Its last snapshot is enough: no worker loads its state at the pause as well."""
    monkeypatch.setattr(population, "PROGRESS_SECONDS", 0.0)
    spec = LaneSpec(id="human", program="human")
    again = [dataclasses.replace(spec, paused=paused([spec], until=2)["human"].paused)]
    first = Population("cartpole", again, SMALL, threads=1)
    progress = next(first.train())
    assert isinstance(progress, TrainingProgress) and progress.epoch == 3
    request = pack_lanes("cartpole", again, SMALL)
    resumed = Frame(request.header, {**request.blobs, SNAPSHOT: first.snapshot()})
    assert unpack_lanes(request)[1] == again and unpack_lanes(resumed)[1] == [spec]
    second = Population(*unpack_lanes(resumed), threads=1)
    second.resume(resumed.blobs[SNAPSHOT])
    (result,) = [x for x in second.train() if isinstance(x, TrainingResult)]
    assert dataclasses.replace(result, seconds=0.0) == dataclasses.replace(results([spec])["human"], seconds=0.0)


def test_a_lane_that_paused_goes_on_alone_and_in_other_company():
    specs = [LaneSpec(id=name, program=upright(scale), seed=seed) for name, scale, seed in (("a", -1, 1), ("b", -2, 2))]
    others = [LaneSpec(id="c", program="human", seed=2), LaneSpec(id="d", program=upright(-3), seed=1)]
    first, elsewhere, whole = paused(specs, until=2), paused(others, until=2), results(specs)
    (alone,) = results([dataclasses.replace(specs[1], paused=first["b"].paused)]).values()
    assert alone.curves["reward"] == pytest.approx(whole["b"].curves["reward"], rel=1e-3)
    mixed = [
        dataclasses.replace(others[0], paused=elsewhere["c"].paused),
        dataclasses.replace(specs[1], paused=first["b"].paused),
        dataclasses.replace(others[1], paused=elsewhere["d"].paused),
    ]
    assert results(mixed)["b"].curves["reward"] == pytest.approx(whole["b"].curves["reward"], rel=1e-3)
    assert alone.env_steps == whole["b"].env_steps and len(alone.clock) == 4


def test_lanes_that_paused_on_another_kind_of_device_begin_anew():
    specs = [LaneSpec(id="human", program="human"), LaneSpec(id="own", program=upright(), seed=1)]
    states = {lane: pausing.load(x.paused or b"", torch.device("cpu")) for lane, x in paused(specs, until=2).items()}
    states["own"]["device"] = "cuda"
    states["own"]["ppo"]["generators"] = [torch.zeros(16, dtype=torch.uint8)]  # of the length of a GPU's
    again = [dataclasses.replace(spec, paused=pausing.save(states[spec.id])) for spec in specs]
    whole = results(specs)
    for lane, result in results(again).items():
        assert dataclasses.replace(result, seconds=0.0) == dataclasses.replace(whole[lane], seconds=0.0)


def test_lanes_that_paused_before_their_device_was_kept_go_on():
    specs = [LaneSpec(id="human", program="human")]
    state = pausing.load(paused(specs, until=2)["human"].paused or b"", torch.device("cpu"))
    del state["device"], state["curves"]["where"]
    (again,) = results([dataclasses.replace(specs[0], paused=pausing.save({**state, "seconds": 1000.0}))]).values()
    assert again.seconds > 1000.0 and again.curves["reward"] == results(specs)["human"].curves["reward"]


def test_what_a_part_of_a_training_newly_remembers_is_kept(monkeypatch: pytest.MonkeyPatch):
    class Longer(Curves):
        seen = 0

        def lane_state(self, lane: int) -> dict[str, Any]:
            return {**super().lane_state(lane), "seen": self.seen}

        def load_lanes(self, lanes: Sequence[Mapping[str, Any]]) -> None:
            super().load_lanes(lanes)
            self.seen = lanes[0]["seen"]

    monkeypatch.setattr(population, "Curves", Longer)
    first, second = (Population("cartpole", [LaneSpec(id="a", program="human")], SMALL, threads=1) for _ in range(2))
    assert isinstance(first.curves, Longer) and isinstance(second.curves, Longer)
    first.curves.seen = 7
    second.resume(first.snapshot())
    assert second.curves.seen == 7


@pytest.fixture
def levels(tmp_path: Path) -> str:
    """A task whose memory `level` counts the steps of each world, and is its F; no reset writes it."""
    text = LUCKY.replace('memory = ("lucky",)', 'memory = ("lucky", "level")')
    text = text.replace("self.lucky =", "self.level = torch.zeros(self.num_envs); self.lucky =")
    text = text.replace("mean_over_episodes(self.lucky, ended)", "mean_over_steps(self.level)")
    count = "\n    def outcome(self, s):\n        self.level = self.level + 1.0\n"
    (tmp_path / "levels.py").write_text(f"{text}{count}".replace("mean_over_episodes", "mean_over_steps"))
    return f"{tmp_path}/levels.py"


def test_fitness_of_steps_is_averaged_over_as_many_epochs_as_an_episode_lasts(levels: str):
    budget = dataclasses.replace(SMALL, env_steps=16 * 32 * 6)
    messages = Population(levels, [LaneSpec(id="a", program="human")], budget, threads=1).train()
    (found,) = (message for message in messages if isinstance(message, TrainingResult))
    # An episode takes 64 steps: four epochs of 16. Steps 1 to 64 have the mean 32.5, 17 to 80 48.5, 33 to 96 64.5.
    assert found.curves["fitness"] == (None, None, None, 32.5, 48.5, 64.5)


def test_a_lane_that_paused_keeps_what_its_task_remembers(levels: str):
    specs = [LaneSpec(id=name, program="human", seed=i) for i, name in enumerate("ab")]
    first = Population(levels, specs, dataclasses.replace(SMALL, until=0.5), threads=1)
    states = {x.lane: x.paused for x in first.train() if isinstance(x, TrainingResult)}
    (alone,) = [dataclasses.replace(spec, paused=states[spec.id]) for spec in specs[1:]]
    assert Population(levels, [alone], SMALL, threads=1).env.task.level.tolist() == [32.0] * 32
