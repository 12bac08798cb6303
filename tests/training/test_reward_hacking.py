"""On Cartpole, whose F is how long the pole stays up, a reward for speed alone shows a sign of hacking. The human
reward shows none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from openeureka.method import hacking
from openeureka.method.hacking import Kind, Sign
from openeureka.suite.isaac.cartpole import Cartpole
from openeureka.training.evaluate import concentration, evaluate, summed_up
from openeureka.training.policy import Policy
from openeureka.training.population import Population
from openeureka.types import (
    Dynamics,
    Evaluation,
    LaneSpec,
    Node,
    Observe,
    RewardGraph,
    RewardProgram,
    TrainBudget,
    TrainingResult,
    Tryout,
)

SPEED = RewardGraph(nodes=(Node("input", ("cart_velocity",)),), reward=0, components=())
"""The faster the cart runs off its rail, the better."""


@pytest.fixture(scope="module")
def signs() -> dict[str, tuple[Sign, ...]]:
    """The signs of each reward, trained and tried out as in a run, but with one lane and 32 held-out episodes each."""
    programs: dict[str, RewardProgram] = {"speed": SPEED, "human": "human"}
    specs = [LaneSpec(id=name, program=program, seed=1) for name, program in programs.items()]
    population = Population("cartpole", specs, TrainBudget(env_steps=16 * 32 * 40, worlds=32), threads=1)
    results = {message.lane: message for message in population.train() if isinstance(message, TrainingResult)}
    tryouts = {
        f"{spec} {tryout.name}": tryout
        for spec, result in results.items()
        for tryout in (
            Tryout(lane=spec, name="peak of own reward", peak="reward"),
            *hacking.tryouts({spec: result}, spec, 1, {spec: "reward"}),
        )
    }
    peaks = {(spec, "fitness"): result.best_fitness for spec, result in results.items()}
    peaks |= {(spec, "reward"): result.best_reward for spec, result in results.items()}
    policies = {key: peak.policy for key, tryout in tryouts.items() if (peak := peaks[tryout.lane, tryout.peak])}
    dynamics = {key: tryout.dynamics for key, tryout in tryouts.items()}
    untrained = {key: seed for key, tryout in tryouts.items() if (seed := tryout.untrained) is not None}
    scores = evaluate("cartpole", policies, seed=5, dynamics=dynamics, untrained=untrained, episodes=32, threads=1)
    found: dict[str, dict[str, Evaluation]] = {spec: {} for spec in results}
    for score in scores:
        found[tryouts[score.lane].lane][tryouts[score.lane].name] = score
    held_out = {spec: replace(found[spec]["peak of own reward"], peak="reward") for spec in results}
    return {spec: hacking.signs(hacking.tried({spec: results[spec]}, held_out, found), {}) for spec in results}


def test_a_hacked_reward_is_flagged(signs: dict[str, tuple[Sign, ...]]):
    (sign,) = signs["speed"]
    assert sign.kind is Kind.DRIFT
    assert "its reward rose from" in sign.sentence and "held-out F fell from" in sign.sentence


def test_an_honest_reward_is_not(signs: dict[str, tuple[Sign, ...]]):
    assert signs["human"] == ()


@pytest.mark.parametrize("observe", ["all", "measurable"])
def test_an_untrained_policy_is_the_one_that_a_training_begins_with(observe: Observe):
    budget = TrainBudget(env_steps=16 * 8 * 6, worlds=8, observe=observe)
    population = Population("cartpole", [LaneSpec(id="a", program="human", seed=3)], budget, threads=1)
    begun = population._now(0).to_bytes()
    (result,) = (message for message in population.train() if isinstance(message, TrainingResult))
    learnt = result.last or b""
    assert learnt != begun and Policy.from_bytes(learnt).untrained(3, Cartpole.recipe).to_bytes() == begun
    policies, untrained = {"a": learnt, "b": learnt, "c": begun}, {"b": 3}
    scores = evaluate("cartpole", policies, seed=5, untrained=untrained, episodes=8, threads=1)
    a, b, c = (replace(score, lane="") for score in scores)
    assert b == c != a and policies["b"] == learnt


def test_more_worlds_than_there_is_room_for_are_played_in_turn(monkeypatch: pytest.MonkeyPatch):
    lanes = [LaneSpec(id=name, program="human", seed=seed) for seed, name in enumerate("abc")]
    population = Population("cartpole", lanes, TrainBudget(env_steps=16 * 8 * 2, worlds=8), threads=1)
    results = [message for message in population.train() if isinstance(message, TrainingResult)]
    policies = {result.lane: result.last or b"" for result in results}
    dynamics = {"b": Dynamics(friction=0.5)}
    together = evaluate("cartpole", policies, seed=5, dynamics=dynamics, episodes=8, threads=1)
    monkeypatch.setattr("openeureka.training.evaluate.WORLDS", 17)  # two policies at once
    in_turn = evaluate("cartpole", policies, seed=5, dynamics=dynamics, episodes=8, threads=1)
    assert [(one.lane, one.episodes) for one in in_turn] == [("a", 8), ("b", 8), ("c", 8)]
    assert [one.fitness for one in in_turn] == pytest.approx([one.fitness for one in together])


def test_episodes_that_break_the_physics_are_counted_apart(tmp_path: Path):
    """Poles that start to the left spin too fast to be simulated. Each of the other episodes lasts its 7 steps."""
    (tmp_path / "loose.py").write_text("""
from openeureka.suite.isaac.cartpole import Cartpole

class Loose(Cartpole):
    env = "loose"
    episode_length = 8

    def reset(self, worlds):
        super().reset(worlds)
        self.qvel[worlds, 1] += 1e4 * (self.qpos[worlds, 1] < 0)
""")
    env, spec = f"{tmp_path}/loose.py", LaneSpec(id="a", program="human")
    population = Population(env, [spec], TrainBudget(env_steps=16 * 8, worlds=8), threads=1)
    (result,) = (message for message in population.train() if isinstance(message, TrainingResult))
    (score,) = evaluate(env, {"a": result.last or b""}, seed=5, episodes=64, threads=1)
    assert 16 < score.lost < 48 and score.episodes == 64 - score.lost
    assert score.fitness == 7.0
    (sound,) = evaluate("cartpole", {"a": result.last or b""}, seed=5, episodes=64, threads=1)
    assert (sound.episodes, sound.lost) == (64, 0)


def test_the_error_of_a_score_is_that_of_a_ratio_of_two_sums():
    """Two worlds: F of 2 over one step and of 9 over three."""
    sums = torch.tensor([[2.0, 9.0], [1.0, 3.0], [1.0, 3.0]], dtype=torch.float64)
    score = summed_up("a", sums, torch.ones(4), 0, {}, None)
    assert (score.fitness, score.episode_length) == (2.75, 2.0)  # (2 + 9) / (1 + 3), and 4 steps of 2 worlds
    # 2 - 2.75 * 1 = -0.75 and 9 - 2.75 * 3 = 0.75: sqrt((0.75^2 + 0.75^2) * 2 / 1) = 1.5, over a weight of 4.
    assert score.error == pytest.approx(0.375)


def test_concentration_is_the_share_of_the_highest_twentieth():
    # Of 40 contributions the highest twentieth is two: 10 + 10 of 20 + 38 * 1.
    assert concentration(torch.tensor([10.0] * 2 + [1.0] * 38)) == pytest.approx(20 / 58)
    # Contributions that are not positive do not count: of 20 positive ones the highest twentieth is one, 5 of 5 + 19.
    assert concentration(torch.tensor([5.0] + [1.0] * 19 + [0.0, -7.0] * 50)) == pytest.approx(5 / 24)


def test_rare_successes_of_equal_worth_are_not_concentrated():
    for successes in (1, 7, 20, 33):
        assert concentration(torch.tensor([1.0] * successes + [0.0] * 980)) == pytest.approx(1 / 20)
    assert concentration(torch.tensor([1.0, 0.5])) == pytest.approx(0.1 / 1.5)  # a tenth of the higher of two


def test_a_score_that_is_never_positive_has_no_concentration():
    assert concentration(torch.tensor([-1.0, 0.0])) is None
