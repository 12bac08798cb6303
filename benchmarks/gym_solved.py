"""Whether policies solve environments that step themselves, by Gymnasium's threshold, under their own reward.

    python benchmarks/gym_solved.py                            # all of them, three seeds; about 20 minutes on 2 cores
    python benchmarks/gym_solved.py --env gym:CartPole-v1      # one of them; what is known is not trained again

Seeds are lanes of one training, in a run under `outputs/gym_solved/`. F is the return of an episode, held out. The
return that solves an environment is `reward_threshold` of Gymnasium's registry; it has none for Pendulum and MiniGrid.
Writes benchmarks/results/gym_solved.json.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import gymnasium
from lanes import record
from ledger import learn
from records import OUTPUTS, Record, command_line, machine, once, results, show

from openeureka.config import TrainConfig
from openeureka.numbers import number, spread
from openeureka.tasks import registry

STEPS = {
    "gym:CartPole-v1": 500_000,
    "gym:LunarLander-v3": 1_000_000,
    "gym:Pendulum-v1": 500_000,
    "gym:minigrid:MiniGrid-Empty-5x5-v0": 100_000,
}
"""Environment steps of a lane."""
RESULTS = results("gym_solved")
TITLES = ("environment", "steps", "return, held out", "solved at", "seeds that solve it", "minutes")


def measure(env: str, seeds: int) -> Record:
    """One record per seed, all trained side by side."""
    folder = OUTPUTS / "gym_solved" / env.removeprefix("gym:").replace(":", "_")
    config = TrainConfig(env=env, reward="human", seeds=seeds, steps=STEPS[env], dir=str(folder))
    lanes = learn(config, ("fitness",))
    return {
        "solved_at": threshold(env),
        "env_steps": STEPS[env],
        "worlds": registry.get(env).recipe.worlds,
        "minutes": round(max(result.seconds for result, _ in lanes.values()) / 60, 1),
        **machine("cpu"),
        "lanes": {name: record(*found) for name, found in sorted(lanes.items())},
    }


def threshold(env: str) -> float | None:
    """The return that solves an environment, in Gymnasium's registry."""
    registry.get(env)  # which imports its package
    return gymnasium.spec(env.rpartition(":")[2]).reward_threshold


def rows(measured: Mapping[str, Record]) -> list[list[str]]:
    """One row per environment."""
    return [[env.removeprefix("gym:"), *_row(measured[env])] for env in STEPS if env in measured]


def _row(found: Record) -> list[str]:
    returns: Sequence[float | None] = [
        lane["held_out_at_peak_of_fitness"]["fitness"] for lane in found["lanes"].values()
    ]
    bar = found["solved_at"]
    solved = sum(value is not None and value >= bar for value in returns) if bar is not None else None
    return [
        f"{found['env_steps']:,}",
        spread(returns),
        number(bar, 3) if bar is not None else "nobody says",
        f"{solved} of {len(returns)}" if solved is not None else "-",
        f"{found['minutes']:.0f}",
    ]


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--env", action="append", choices=list(STEPS), help="an environment; may be repeated")
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    for env in options.env or STEPS:
        found = once(RESULTS, env, partial(measure, env, options.seeds))
        if len(found["lanes"]) != options.seeds:
            print(f"{env} is known with {len(found['lanes'])} seeds, and not trained again.")
        show(*rows({env: found}))


if __name__ == "__main__":
    main()
