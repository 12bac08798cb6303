"""Baselines that were measured beforehand are those of the policies that a run would have kept."""

from openeureka.config import RunConfig
from openeureka.method import baselines
from openeureka.stats import mean


def test_a_run_is_compared_with_the_policy_that_plays_better_of_both_that_were_measured(monkeypatch):
    poor = {"training": [320.0], "held_out": {"fitness": [266.0, 320.0], "reward": [64.0, 92.0]}}
    rich = {"training": [499.0], "held_out": {"fitness": [403.0], "reward": [499.0]}}
    entry = {"human": rich, "sparse": poor, "env_steps": 1, "worlds": 1, "device": "", "date": ""}
    monkeypatch.setattr(baselines, "_shipped", lambda: {"cartpole": entry})

    def held_out(search: str) -> tuple[float | None, float | None]:
        found = baselines.measured(RunConfig(env="cartpole", search=search))
        assert found is not None
        return mean(found.human.held_out), mean(found.sparse.held_out)

    assert held_out("best") == (499.0, 293.0)
    assert held_out("eureka") == (403.0, 293.0)


def test_what_ships_holds_no_degenerate_end_of_the_scale():
    """Where a sparse reward hardly tells policies apart, the policy at its peak may be a poor one. The lower end of the
    scale is then that of the policy at the peak of F."""
    found = baselines.measured(RunConfig(env="ballbalance"))
    assert found is not None and (mean(found.sparse.held_out) or 0.0) > 250.0
