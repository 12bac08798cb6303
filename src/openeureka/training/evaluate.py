"""Held-out scores: policies play episodes that no training saw, in the task's world or a slightly changed one."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import torch
from torch import Tensor

from ..tasks import registry
from ..tasks.costs import Meter
from ..tasks.env import BatchedEnv
from ..types import NOMINAL, Dynamics, Episodes, Evaluation, Ranges
from .episodes import Recorder
from .policy import Player, Policy

HELD_OUT_SEED = 1 << 32
"""Added to the seed, so that start states are drawn differently from those of training. Environments with a random
generator of their own (`gym:`) have only 2^31 seeds: now and then a seed of training recurs."""
EPISODES = 256
"""Episodes of each policy, by default."""
WORLDS = 16384
"""Most worlds simulated at once; a world costs about 0.15 MB, on a GPU up to 2.1 MB (measured with two hands)."""
LOOK = 32
"""[steps] between two looks, on a GPU, at whether any world still plays."""
ROUNDING = 1e-4
"""Start states that differ by less count as equal; on a GPU contacts are summed in an order that varies."""
HIGHEST = 20
"""One in this many contributions to F counts as among the highest."""


def evaluate(
    env: str,
    policies: Mapping[str, bytes],
    *,
    seed: int,
    dynamics: Mapping[str, Dynamics] | None = None,
    episodes: int = 0,
    record: Collection[str] = (),
    untrained: Mapping[str, int] | None = None,
    noise: bool | None = None,
    device: str = "cpu",
    threads: int = 0,
    alive: Callable[[], None] = lambda: None,
) -> list[Evaluation]:
    """Score every policy of one task side by side, on the same start states.

    Each world plays one episode; what follows there does not count, and need not be simulated. F is averaged over these
    episodes as the task defines it. Costs are measured in the same episodes.

    Policies play without noise, except where all episodes begin alike: without noise these would be the same episode.

    Args:
        policies: lane id to safetensors bytes; equal network shapes.
        episodes: of each policy; 0 for `EPISODES`.
        dynamics: by lane id, the changed world that the policy plays in. A task without MuJoCo has no changed worlds:
            there such lanes play no episode and have no score.
        record: the lanes some of whose episodes come with the score.
        untrained: by lane id, the seed whose initial weights play in place of the policy's.
        noise: whether actions have the noise of training; None for only where all episodes begin alike.
        alive: called after every step of all worlds, and around other work that may take minutes.
    """
    worlds, seed = episodes or EPISODES, seed + HELD_OUT_SEED
    changed = {lane: world for lane, world in (dynamics or {}).items() if world != NOMINAL}
    task = registry.get(env)
    left = {lane: Policy.from_bytes(data) for lane, data in policies.items()}
    left |= {lane: left[lane].untrained(own, task.recipe) for lane, own in (untrained or {}).items()}
    scores: list[Evaluation] = []
    if task.steps_itself:
        unplayed = [lane for lane in left if lane in changed]
        scores += [Evaluation(lane=lane, fitness=None, episode_length=0.0, episodes=0) for lane in unplayed]
        left = {lane: policy for lane, policy in left.items() if lane not in changed}
    names, most = list(left), max(1, WORLDS // worlds)
    for first in range(0, len(names), most):
        together = {lane: left[lane] for lane in names[first : first + most]}
        own = [changed.get(lane, NOMINAL) for lane in together]
        ranges = [Ranges(world, world) for world in own] if changed and not task.steps_itself else []
        alive()
        simulation = registry.make(
            env, worlds=worlds, lane_seeds=[seed] * len(own), device=device, threads=threads, ranges=ranges
        )
        alive()
        scores += _side_by_side(simulation, together, seed, record, noise, alive)
    return scores


def _side_by_side(
    simulation: BatchedEnv,
    policies: Mapping[str, Policy],
    seed: int,
    record: Collection[str],
    noise: bool | None,
    alive: Callable[[], None],
) -> list[Evaluation]:
    """Scores of policies, each of which is a lane of the simulation; `seed` is that of the action noise."""
    lanes = len(policies)
    worlds = simulation.num_worlds // lanes
    meter = Meter(simulation)
    recorded = [place for place, lane in enumerate(policies) if lane in record]
    recorder = Recorder(simulation.task.spec, recorded, worlds)
    observation = simulation.reset()
    alive()
    noisy = begin_alike(simulation, lanes) if noise is None else noise
    play = Player(list(policies.values()), simulation.sim.device, noise=seed if noisy else None)
    total, contributions, broken = _play_once(simulation, observation, play, meter, recorder, alive)
    sums, parts = (x.unflatten(1, (lanes, worlds)).transpose(0, 1) for x in (total, contributions))
    lost = broken.view(lanes, worlds).sum(1).tolist()
    costs = meter.read(lanes)
    kept = dict(zip(recorded, recorder.read([sums[place] for place in recorded]), strict=True))
    return [
        replace(summed_up(lane, sums[i], parts[i], lost[i], costs[i], kept.get(i)), noisy=noisy)
        for i, lane in enumerate(policies)
    ]


def begin_alike(simulation: BatchedEnv, lanes: int = 1) -> bool:
    """Whether, before the first step, all worlds of each lane are in the same state, up to rounding.

    False where a lane has a single world, and for tasks without MuJoCo: their equal starts may go on differently.
    """
    if simulation.task.steps_itself or simulation.num_worlds == lanes:
        return False
    state, spec = simulation.current_state(), simulation.task.spec
    worlds = (state[name].float().unflatten(0, (lanes, -1)) for name in spec.per_world)
    return all(bool(torch.isclose(x, x[:, :1], rtol=ROUNDING, atol=ROUNDING).all()) for x in worlds)


def _play_once(
    simulation: BatchedEnv,
    observation: Tensor,
    play: Player,
    meter: Meter,
    recorder: Recorder,
    alive: Callable[[], None],
) -> tuple[Tensor, Tensor, Tensor]:
    """Play one episode in every world. Returns sums (3, N) of value times weight, weight, and steps; contributions
    (steps, N) to the first of these sums; and (N,) bool, true where the physics broke down."""
    running = torch.ones(simulation.num_worlds, dtype=torch.bool, device=observation.device)
    simulation.sim.playing = running  # shared, and updated in place below
    broken = torch.zeros_like(running)
    total = torch.zeros(3, simulation.num_worlds, dtype=torch.float64, device=observation.device)
    contributions: list[Tensor] = []
    for number in itertools.count():
        # On a GPU the host looks only now and then whether any world still plays: looking waits for the device.
        if number % (LOOK if simulation.masked else 1) == 0 and not bool(running.any()):
            break
        step = simulation.step(play(observation))
        weight = step.score.weight * running
        contributions.append(torch.where(running, step.score.value, 0.0) * weight)
        total += torch.stack([contributions[-1], weight, running])
        meter.add(step, running)
        recorder.add(number, step.state, running)
        broken |= step.bad & running
        running &= ~step.done
        observation = step.observation
        alive()
    simulation.check()
    return total, torch.stack(contributions), broken


def summed_up(
    lane: str, sums: Tensor, contributions: Tensor, lost: int, costs: Mapping[str, float], recorded: Episodes | None
) -> Evaluation:
    """One lane's score from the sums (3, n) of value times weight, weight, and steps of each world, the contributions
    (steps, n) to the first of these sums, and the number of worlds whose physics broke down."""
    value, weight, steps = sums
    worlds, whole = len(weight), float(weight.sum())
    fitness = float(value.sum()) / whole if whole else None
    error = None
    if fitness is not None and worlds > 1:
        # F is a ratio of two sums over worlds: its variance to first order (Cochran, Sampling Techniques, 2.11).
        error = math.sqrt(float((value - fitness * weight).square().sum()) * worlds / (worlds - 1)) / whole
    return Evaluation(
        lane=lane,
        fitness=fitness,
        episode_length=float(steps.sum()) / worlds,
        episodes=worlds - lost,
        lost=lost,
        error=error,
        concentration=concentration(contributions),
        costs=costs,
        recorded=recorded,
    )


def concentration(contributions: Tensor) -> float | None:
    """Share of the sum of positive contributions (any shape) that the highest twentieth of them makes up.

    None where no contribution is positive, such as where F is a negative distance: no state can be worth much there.
    Where F counts successes, all contributions are equal and the share is a twentieth, however rare successes are.
    """
    positive = contributions[contributions > 0].double()
    if not len(positive):
        return None
    whole, part = divmod(len(positive) / HIGHEST, 1.0)  # the last of the twentieth counts in part
    highest = positive.topk(min(len(positive), int(whole) + 1)).values
    return float((highest[: int(whole)].sum() + part * highest[-1]) / positive.sum())
