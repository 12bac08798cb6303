"""One lane of the population trainer against rsl_rl's PPO: same task, reward, network, batch, steps and seeds. A
sentence of docs/concepts/training.md.

    python benchmarks/parity.py                    # needs the extra `bench`; Ant, 3 seeds, about 5 minutes on 2 cores
    python benchmarks/parity.py --tiny             # one seed of 20,000 steps, to see that it works; kept nowhere

What differs on purpose: rsl_rl keeps actor and critic apart, shuffles minibatches, measures the divergence from the
policy that collected the data, and values a time-out by the state before it. The means of its first actions are as its
initial weights give them, whatever the recipe's `head`. Both receive the human reward times the recipe's scale; F comes
from the environment, which neither learner can change. Our side is a run for each seed under `outputs/parity/`: what is
trained there is not trained again.
"""

from __future__ import annotations

import contextlib
import io
import statistics
import time
from collections.abc import Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import torch
from intervals import interval_or_dash
from ledger import learn
from records import OUTPUTS, Record, command_line, keep, machine, results
from throughput import sleep_when_idle

from openeureka.config import TrainConfig
from openeureka.numbers import number, spread
from openeureka.stats import difference
from openeureka.tasks import registry

RESULTS = results("parity")
WORLDS = 512
TAIL = 0.1  # the share of epochs at the end whose mean F is compared


class Adapter:
    """A task as an environment of rsl_rl; keeps the score and its weight of every step."""

    def __init__(self, env: str, worlds: int, seed: int) -> None:
        self.simulation = registry.make(env, worlds=worlds, lane_seeds=[seed])
        self.task = self.simulation.task
        self.num_envs, self.num_actions = worlds, self.task.num_actions
        self.max_episode_length, self.device = self.task.episode_length, self.simulation.sim.device
        self.episode_length_buf, self.cfg = self.task.progress, {}
        self.scores: list[tuple[float, float]] = []
        self.observation = self.simulation.reset()

    def get_observations(self) -> Any:
        from tensordict import TensorDict  # needed only here, like rsl_rl: pages are made from results without them

        return TensorDict({"policy": self.observation}, batch_size=[self.num_envs])

    def step(self, actions: torch.Tensor) -> tuple[Any, torch.Tensor, torch.Tensor, dict[str, Any]]:
        step = self.simulation.step(actions)
        value, weight = step.score
        self.scores.append((float((value * weight).sum()), float(weight.sum())))
        self.observation = step.observation
        with torch.inference_mode(False):  # rsl_rl collects in inference mode, in which no reward can be traced
            reward = self.task.human_reward(step.state) * self.task.recipe.reward_scale
        return self.get_observations(), reward, step.done.long(), {"time_outs": step.timed_out.float()}

    def curve(self, horizon: int) -> list[float | None]:
        """F of each epoch of `horizon` steps."""
        epochs = [self.scores[i : i + horizon] for i in range(0, len(self.scores), horizon)]
        totals = [(sum(value for value, _ in epoch), sum(weight for _, weight in epoch)) for epoch in epochs]
        return [value / weight if weight else None for value, weight in totals]


def configuration(env: str) -> dict[str, Any]:
    """The task's recipe in rsl_rl's words."""
    recipe = registry.get(env).recipe
    network = {
        "class_name": "MLPModel",
        "hidden_dims": list(recipe.hidden),
        "activation": "elu",
        "obs_normalization": True,
    }
    return {
        "num_steps_per_env": recipe.horizon,
        "save_interval": 1_000_000,
        "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "actor": network
        | {"distribution_cfg": {"class_name": "GaussianDistribution", "init_std": recipe.noise, "std_type": "log"}},
        "critic": dict(network),
        "algorithm": {
            "class_name": "PPO",
            "num_learning_epochs": recipe.epochs,
            "num_mini_batches": recipe.minibatches,
            "clip_param": recipe.clip,
            "gamma": recipe.gamma,
            "lam": recipe.gae_lambda,
            "value_loss_coef": 0.5 * recipe.critic_coef,
            "entropy_coef": recipe.entropy_coef,
            "learning_rate": recipe.learning_rate,
            "max_grad_norm": recipe.max_grad_norm or 1e9,
            "schedule": "adaptive",
            "desired_kl": recipe.kl_threshold,
        },
    }


def theirs(env: str, worlds: int, steps: int, seed: int) -> tuple[list[float | None], float]:
    """F of every epoch, and seconds."""
    from rsl_rl.runners import OnPolicyRunner

    started = time.perf_counter()
    horizon = registry.get(env).recipe.horizon
    torch.manual_seed(seed)
    adapter = Adapter(env, worlds, seed)
    with contextlib.redirect_stdout(io.StringIO()):  # it prints a table every epoch
        OnPolicyRunner(adapter, configuration(env), log_dir=None, device="cpu").learn(steps // (worlds * horizon))
    return adapter.curve(horizon), time.perf_counter() - started


def ours(folder: Path, env: str, worlds: int, steps: int, seed: int) -> tuple[list[float | None], float]:
    directory = folder / f"{env}_{steps}_{worlds}_s{seed}"
    config = TrainConfig(env=env, reward="human", seed=seed, steps=steps, worlds=worlds, dir=str(directory))
    ((result, _),) = learn(config, ()).values()
    return list(result.curves["fitness"]), result.seconds


def tail(curve: list[float | None]) -> float:
    """Mean F of the last epochs that have one."""
    known = [value for value in curve if value is not None]
    return statistics.fmean(known[-max(1, round(TAIL * len(known))) :])


def compare(env: str, steps: int, worlds: int, seeds: int, folder: Path) -> dict[str, Any]:
    epoch = worlds * registry.get(env).recipe.horizon
    epochs = max(1, steps // epoch)
    found: dict[str, list[dict[str, Any]]] = {"ours": [], "rsl_rl": []}
    for seed in range(seeds):
        for name, train in (("ours", partial(ours, folder)), ("rsl_rl", theirs)):
            curve, seconds = train(env, worlds, epochs * epoch, seed)
            found[name].append({"seed": seed, "final": tail(curve), "seconds": seconds})
            found[name][-1]["curve"] = [None if v is None else round(v, 3) for v in curve[:: max(1, epochs // 50)]]
            print(f"{name:7s} seed {seed}: F {found[name][-1]['final']:.3f}", flush=True)
    finals = {name: [run["final"] for run in runs] for name, runs in found.items()}
    means = {name: statistics.fmean(values) for name, values in finals.items()}
    spreads = {name: statistics.stdev(values) if seeds > 1 else None for name, values in finals.items()}
    return {
        "env_steps": epochs * epoch,
        "worlds": worlds,
        "final_fitness": finals,
        "mean": means,
        "standard_deviation": spreads,
        "difference": means["ours"] - means["rsl_rl"],
        "runs": found,
        **machine("cpu"),
        "versions": {name: version(name) for name in ("mujoco", "torch", "rsl-rl-lib")},
    }


def sentence(measured: Mapping[str, Record]) -> str:
    """How far apart both end on each task, and which is quicker."""
    return " ".join(_sentence(env, found) for env, found in measured.items()) + "\n"


def _sentence(env: str, found: Record) -> str:
    ours, theirs = (found["final_fitness"][name] for name in ("ours", "rsl_rl"))
    seconds = [statistics.fmean(run["seconds"] for run in found["runs"][name]) for name in ("ours", "rsl_rl")]
    apart = difference(ours, theirs)
    between = f": a difference of {interval_or_dash(apart, 2)}" if apart else ""
    return (
        f"On `{env}`, F of the last tenth of {found['env_steps']:,} steps is {spread(ours)} with one lane and "
        f"{spread(theirs)} with rsl_rl's PPO ({len(ours)} seeds){between}. rsl_rl's takes "
        f"{number(seconds[1] / seconds[0], 2)} times as long."
    )


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", default="ant")
    parser.add_argument("--steps", type=int, default=1_000_000, help="of each run, down to whole epochs")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--tiny", action="store_true", help="one seed of 20,000 steps, kept nowhere")
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    sleep_when_idle()
    steps, seeds = (20_000, 1) if options.tiny else (options.steps, options.seeds)
    found = compare(options.env, steps, WORLDS, seeds, OUTPUTS / "parity")
    print(f"ours - rsl_rl: {found['difference']:+.3f}; spread over seeds {found['standard_deviation']}")
    if not options.tiny:
        keep(options.out, options.env, found)


if __name__ == "__main__":
    main()
