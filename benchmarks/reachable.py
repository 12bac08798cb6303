"""Can every task be done at all? A search for actions that do it, in the tasks that no policy has done yet.

    python benchmarks/reachable.py                                  # every task of `reachable_aims.py` not yet done
    python benchmarks/reachable.py --env shadow_hand_kettle         # one
    python benchmarks/reachable.py --env shadow_hand_kettle --again # anew, from the plan written by hand
    make docs                                                       # the table in docs/concepts/benchmark.md

A plan is a list of actions, each held for a while, without feedback. The cross-entropy method improves it in worlds
that all begin alike. The search looks at the whole state, but only the task's own actions move the worlds. A plan is
then worth the task's own F, in episodes that begin as the task has them begin. `results/reachable.json` keeps both; a
search that found nothing goes on from its best.
"""

from __future__ import annotations

import time
from collections.abc import Sequence

import torch
from reachable_aims import AIMS, Aim
from records import Record, command_line, keep, machine, read, results
from torch import Tensor

from openeureka.tasks import registry
from openeureka.tasks.env import BatchedEnv

RESULTS = results("reachable")
WORLDS = 24
SECONDS = 240.0
"""[s] of search for a task."""
SEED = 8_000_000
"""Seed of the start that is searched. The plan's episodes begin with this seed and those after it."""
EPISODES = 32
HAND = 26  # actions of one hand
LOOK = 3  # steps between two looks at the state, which cost as much as the physics
DECIMALS = 2  # of the actions of a plan
DONE = 10.0  # what success is worth against progress

TITLES = ("task", "F of a start", f"F of {EPISODES} starts", "how", "steps of search", "minutes", "date")


def plan_of(aim: Aim, known: Record) -> Tensor:
    """(K, A) the actions to begin with: those written by hand, unless the similar task `aim.like` has been done."""
    if not known.get(aim.like, {}).get("f"):
        return torch.tensor(aim.guess)
    right = torch.tensor(known[aim.like]["plan"])[:, :HAND]
    half_around = torch.ones(HAND)
    half_around[[0, 1, 3, 4]] = -1.0  # force and torque along x and y
    return torch.cat((right, half_around * right), dim=-1)


def played(env: BatchedEnv, plans: Tensor, steps: int, aim: Aim, look: int) -> tuple[Tensor, Tensor]:
    """Greatest progress (N,) and greatest outcome (N,) of the first episode in each world, under plans (N, K, A).

    Looks at the state every `look` steps; in between, no episode ends or succeeds.
    """
    task = env.task
    task.noise.draws.zero_()  # the same start each time
    env.reset()
    best, done = torch.full((len(plans),), -torch.inf), torch.zeros(len(plans))
    alive = torch.ones(len(plans), dtype=torch.bool)
    for step in range(steps):
        task.actions = plans[:, step * plans.shape[1] // steps].clamp(-1.0, 1.0)
        task.apply_action(task.actions)
        task.advance()
        task.progress += 1
        if (step + 1) % look and step + 1 < steps:
            continue
        state = task.compute_state()
        alive &= ~env.sim.bad
        done = torch.where(alive, torch.maximum(done, aim.success(task, state).float()), done)
        best = torch.where(alive, torch.maximum(best, aim.progress(task, state)), best)
        alive &= ~task.terminated(state)
        if not alive.any():
            break
    return best.nan_to_num(neginf=-100.0), done


def search(aim: Aim, plan: Tensor, *, worlds: int, seconds: float) -> tuple[Tensor, float, int]:
    """The best plan (K, A) there was, how near it came, and the steps simulated; stops at the first success."""
    task = registry.get(aim.env)
    steps = aim.steps or task.episode_length
    env = registry.make(aim.env, worlds=1, lane_seeds=[SEED] * worlds)
    generator = torch.Generator().manual_seed(SEED)
    mean, spread = plan, torch.zeros_like(plan)
    spread[:, slice(*aim.moves)] = aim.spread
    best, best_score, begun, spent = plan, -torch.inf, time.monotonic(), 0
    while time.monotonic() - begun < seconds:
        plans = mean + spread * torch.randn((worlds, *plan.shape), generator=generator)
        plans[0], plans[1] = mean, best
        plans = _rounded(plans)
        progress, done = played(env, plans, steps, aim, LOOK)
        spent += worlds * steps
        score = progress + DONE * done
        elite = plans[score.argsort(descending=True)[: max(4, worlds // 6)]]
        if score.max() > best_score:
            best, best_score = plans[score.argmax()].clone(), float(score.max())
        mean = elite.mean(dim=0)
        spread = torch.maximum(0.5 * spread + 0.5 * elite.std(dim=0), 0.3 * aim.spread * (spread > 0))
        print(f"{aim.env}: {best_score:.3f}, now {float(progress.mean()):.3f}, {spent:,} steps", flush=True)
        if best_score > DONE / 2:
            break
    return best, best_score, spent


def replay(env: str, plan: Sequence[Sequence[float]], steps: int, seeds: Sequence[int]) -> float:
    """F of a plan in one whole episode of each seed: the task's own steps and score, nothing else."""
    batch = registry.make(env, worlds=1, lane_seeds=seeds)
    actions = torch.tensor(plan)
    batch.reset()
    value, weight = torch.zeros(len(seeds)), torch.zeros(len(seeds))
    for step in range(batch.task.episode_length):
        knot = min(step * len(actions) // steps, len(actions) - 1)
        taken = batch.step(actions[knot].expand(len(seeds), -1))
        first = taken.ended & (weight == 0)
        value, weight = torch.where(first, taken.score.value, value), torch.where(first, taken.score.weight, weight)
    return float((value * weight).sum() / weight.sum())


def _rounded(plans: Tensor) -> Tensor:
    return (plans.clamp(-1.0, 1.0) * 10**DECIMALS).round() / 10**DECIMALS


def rows(results: Record) -> list[Sequence[str]]:
    """Rows of the table in the documentation, one for every task of AIMS."""
    return [
        (aim.env.removeprefix("shadow_hand_"), *_found(results[aim.env], aim.how))
        if aim.env in results
        else (aim.env.removeprefix("shadow_hand_"), *["not searched"] * 2, aim.how, "", "", "")
        for aim in AIMS
    ]


def _found(record: Record, how: str) -> Sequence[str]:
    return (
        f"{record['f']:g}",
        f"{record['f_of_starts']:.2g}",
        how,
        f"{record['search_steps']:,}",
        f"{record['seconds'] / 60:.0f}",
        record["date"],
    )


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", choices=[aim.env for aim in AIMS], nargs="*")
    parser.add_argument("--again", action="store_true", help="begin with the plan written by hand")
    options = parser.parse_args()
    torch.set_num_threads(1)  # tensors are small
    for aim in AIMS:
        results = read(RESULTS)
        known: Record = results.get(aim.env, {})
        if (options.env and aim.env not in options.env) or (known.get("f") and not options.again):
            continue
        fresh = options.again or not known
        begun = time.monotonic()
        plan = plan_of(aim, results) if fresh else torch.tensor(known["plan"])
        plan, nearest, spent = search(aim, plan, worlds=WORLDS, seconds=SECONDS)
        steps = aim.steps or registry.get(aim.env).episode_length
        rows = [[round(action, DECIMALS) for action in row] for row in plan.tolist()]
        before = {} if fresh else known
        record = {
            "f": replay(aim.env, rows, steps, [SEED]),
            "f_of_starts": replay(aim.env, rows, steps, range(SEED, SEED + EPISODES)),
            "nearest": nearest,
            "worlds": WORLDS,
            "search_steps": spent + before.get("search_steps", 0),
            "seconds": round(time.monotonic() - begun + before.get("seconds", 0.0)),
            "seed": SEED,
            "episodes": EPISODES,
            "steps": steps,
            **machine("cpu"),
            "plan": rows,
        }
        keep(RESULTS, aim.env, record)
        print(f"{aim.env}: F = {record['f']:.3f}, {record['f_of_starts']:.3f} over starts", flush=True)


if __name__ == "__main__":
    main()
