"""How good is the reward that a schedule chooses? Computed from complete trainings; nothing trains here.

    python benchmarks/choices.py      # the table, also in docs/reference/measurements.md

A schedule sees the trainings of one seed, and cuts by one number at its rungs. The reward that it chooses is judged by
trainings with the other seeds. There are two numbers to cut by, each with its study: F that policies play at the rungs
(`rungs.py`, short trainings), and F in the window of the curves (`predictors.py`, judged by held-out F of
`choosing.py`). All schedules choose in the same searches, so they are compared search by search.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import stdev

import choosing
import predictors
import rungs
from intervals import interval_or_dash
from records import Record, read, show

from openeureka.method.schedule import RUNGS, Rung
from openeureka.numbers import number
from openeureka.score import rank
from openeureka.stats import estimate, mean
from openeureka.types import lane_id

SCHEDULES: Mapping[str, Sequence[Rung]] = {
    "`full`: all to the end": (),
    "halving at 1/8, 1/4, 1/2": RUNGS["halving"],
    "halving at 1/4, 1/2": (Rung(1 / 4, 1 / 2), Rung(1 / 2, 1 / 2)),
    "a quarter goes on at 1/4": RUNGS["quarter"],
    "a quarter goes on at 1/8": (Rung(1 / 8, 1 / 4),),
    "all end at 1/2": (Rung(1 / 2, 0.0),),
    "all end at 1/4": (Rung(1 / 4, 0.0),),
    "all end at 1/8": (Rung(1 / 8, 0.0),),
}
"""Where candidates pause, and what share of them goes on; where none does, the leading one is chosen there."""
MINUS = "minus `full`, 95 % interval"
TITLES = (
    "schedule", "steps, of all", "cut by played F, ± standard error", MINUS,
    "cut by F in the window, ± standard error", MINUS,
)  # fmt: skip


@dataclass(frozen=True)
class Search:
    """The trainings of one task and seed, by reward."""

    told: Mapping[str, Mapping[float, float]]
    """The number that a schedule cuts by, at each share of the training."""
    end: Mapping[str, float]
    """The number that whole trainings are chosen by: played F of the policy that stands for each."""
    worth: Mapping[str, float]
    """F of trainings with the other seeds."""

    def choose(self, schedule: Sequence[Rung]) -> tuple[float, float]:
        """How good the chosen reward is (0 a random one, 1 the best), and the share of the steps it took."""
        alive, spent, before = list(self.end), 0.0, 0.0
        for rung in schedule:
            spent, before = spent + len(alive) * (rung.share - before), rung.share
            alive.sort(key=lambda reward: -self.told[reward][rung.share])
            alive = alive[: max(1, math.ceil(rung.kept * len(alive)))]
        if not schedule or schedule[-1].kept:
            spent += len(alive) * (1.0 - before)
            alive.sort(key=lambda reward: -self.end[reward])
        usual, best = mean([*self.worth.values()]) or 0.0, max(self.worth.values())
        return (self.worth[alive[0]] - usual) / (best - usual), spent / len(self.end)


def by_play() -> Iterator[Search]:
    """The searches of `rungs.py`. The best policy at any rung stands for a whole training, as in a search."""
    for _, _, scores in rungs.studied(read(rungs.RESULTS)):
        for seed in rungs.common_seeds(scores):
            yield Search(
                {reward: dict(zip(rungs.RUNGS, map(rank, by[seed]), strict=True)) for reward, by in scores.items()},
                {reward: rank(rungs.best(by[seed])) for reward, by in scores.items()},
                {reward: rungs.worth(scores, reward, seed, rungs.best) for reward in scores},
            )


def by_window() -> Iterator[Search]:
    """Searches on tasks whose curves and held-out scores are both known, with seeds that most rewards trained with."""
    curves, judged = read(predictors.RESULTS), read(choosing.RESULTS)
    for env in (env for env in choosing.STEPS if env in curves and env in judged):
        lanes = judged[env]["lanes"]
        for seed in choosing.SEEDS:
            worth = {reward: _held_out(lanes, reward, seed) for reward in choosing.generated(lanes)}
            found = {
                reward: curves[env]["lanes"][lane_id(reward, seed)]
                for reward, value in worth.items()
                if value is not None and lane_id(reward, seed) in curves[env]["lanes"]
            }
            if 2 * len(found) > len(worth) and len({worth[reward] for reward in found}) > 1:
                yield Search(
                    {
                        reward: dict(
                            zip(predictors.SHARES, map(rank, lane["signals"][predictors.FITNESS]), strict=True)
                        )
                        for reward, lane in found.items()
                    },
                    {reward: lane["played"] for reward, lane in found.items()},
                    {reward: worth[reward] for reward in found},
                )


def _held_out(lanes: Mapping[str, Record], reward: str, but: int) -> float | None:
    """Held-out F of the policy that stands for each training, mean over all seeds except `but`."""
    others = [lanes[lane] for seed in choosing.SEEDS if seed != but and (lane := lane_id(reward, seed)) in lanes]
    return mean([one["held_out"][choosing.standing(one)]["fitness"] for one in others if one["held_out"]])


def rows() -> list[tuple[str, ...]]:
    """One row per schedule."""
    studies = [*by_play()], [*by_window()]
    return [(title, *_row(studies, schedule)) for title, schedule in SCHEDULES.items()]


def _row(studies: Sequence[Sequence[Search]], schedule: Sequence[Rung]) -> tuple[str, ...]:
    spent = mean([search.choose(schedule)[1] for study in studies for search in study])
    return number(spent, 2), *(cell for study in studies for cell in compared(study, schedule))


def compared(study: Sequence[Search], schedule: Sequence[Rung]) -> tuple[str, str]:
    """How good the chosen rewards are, and how much better than those that whole trainings choose in the same
    searches."""
    chosen = [search.choose(schedule)[0] for search in study]
    less = estimate([own - search.choose(())[0] for own, search in zip(chosen, study, strict=True)])
    return _spread(chosen), interval_or_dash(less, 2) if schedule else "-"


def _spread(found: Sequence[float]) -> str:
    """Mean and its standard error."""
    return f"{number(mean(found), 2)} ± {number(stdev(found) / math.sqrt(len(found)), 2)}"


if __name__ == "__main__":
    show(TITLES, *rows())
