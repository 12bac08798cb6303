"""A reward that pays for speed alone shows the flag on Cartpole, whose F is how long the pole stays up; an honest one
shows none."""

from __future__ import annotations

import pytest
import torch

from openeureka import hacking
from openeureka.hacking import Kind, Sign
from openeureka.training.evaluate import concentration, evaluate
from openeureka.training.population import Population
from openeureka.types import Node, RewardGraph, RewardProgram, TrainBudget, TrainingResult, TrainJob

SPEED = RewardGraph(nodes=(Node("input", ("cart_velocity",)),), reward=0, components=())
"""The faster the cart runs off its rail, the better."""


def signs(name: str, program: RewardProgram) -> tuple[Sign, ...]:
    """Train one lane and look at it as a run does."""
    budget = TrainBudget(env_steps=16 * 32 * 40, worlds=32)
    population = Population("cartpole", [TrainJob(id=name, program=program, seed=1)], budget, threads=1)
    (result,) = (message for message in population.train() if isinstance(message, TrainingResult))
    policies = {"fitness": result.best_fitness, "reward": result.best_reward}
    assert policies["fitness"] is not None and policies["reward"] is not None
    (held_out,) = evaluate("cartpole", {name: policies["reward"].policy}, seed=5, worlds=32, threads=1)
    trials = {trial.name: trial for trial in hacking.trials({name: result}, kept=name, peak="reward")}
    scores = evaluate(
        "cartpole",
        {key: policies[trial.peak].policy for key, trial in trials.items()},  # pyright: ignore[reportOptionalMemberAccess]
        seed=5,
        dynamics={key: trial.dynamics for key, trial in trials.items()},
        worlds=32,
        threads=1,
    )
    found = {score.job: score for score in scores}
    return hacking.signs(hacking.tried({name: result}, {name: held_out}, {name: found}, "reward"))


def test_a_hacked_reward_is_flagged():
    (sign,) = signs("speed", SPEED)
    assert sign.kind is Kind.DRIFT
    assert "the own reward rose from" in sign.sentence and "held-out F fell from" in sign.sentence


def test_an_honest_reward_is_not():
    assert signs("human", "human") == ()


def test_concentration_is_the_share_of_the_highest_twentieth():
    # Of 40 contributions the highest twentieth is two: 10 + 10 of 20 + 38 * 1.
    assert concentration(torch.tensor([10.0] * 2 + [1.0] * 38)) == pytest.approx(20 / 58)
    # Those that are not positive make nothing of F: of 20 positive ones the highest is one, 5 of 5 + 19.
    assert concentration(torch.tensor([5.0] + [1.0] * 19 + [0.0, -7.0] * 50)) == pytest.approx(5 / 24)


def test_rare_successes_of_equal_worth_are_not_concentrated():
    assert concentration(torch.tensor([1.0] * 20 + [0.0] * 980)) == pytest.approx(1 / 20)


def test_a_score_that_is_never_positive_has_no_concentration():
    assert concentration(torch.tensor([-1.0, 0.0])) is None
