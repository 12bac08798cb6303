"""What to type next: the commands that carry on what a run began, or decide what it left open."""

from __future__ import annotations

from ..config import AS_TRAINED, TrainConfig
from ..method.seeds import trained_baselines, unused_seed
from ..parsing import command_line
from ..refine.tuned import ORIGINAL
from ..stats import Difference
from .verdict import FEWEST, enough, lead, limits_reason, none_found, nothing_learnt, ordered
from .view import RunView

WORTH_REPEATING = (*AS_TRAINED, "device", "executor", "address")
"""Settings of a run that `deciding` repeats, where they are not the defaults."""
LONGER = 3
"""How many times the steps a further training is proposed with, where nothing was learnt."""


def commands(run: RunView, directory: str = "DIR", *, kept: bool = True) -> list[tuple[str, str]]:
    """What to type next: the command, and what it does.

    Args:
        kept: whether the run's files exist; without them nothing can be played or trained.
    """
    if none_found(run) or limits_reason(run):
        return [(command_line("show", directory), "what became of each reply")]
    refining = bool(run.config.tune or run.config.polish) and not run.ended
    tuning = run.tunes and not (run.tuned is not None and run.tuned.done)
    if tuning or (run.searched and (run.outcome is None or refining)):
        return [(command_line("resume", directory), "continue where it stopped")]
    if not kept:
        return []
    told = [*deciding(run, directory), (command_line("play", directory), "watch the best reward's policy")]
    if run.polished is not None and run.polished.better:
        told.append((command_line("play", directory, "policy=polished"), "watch the best policy"))
    return told


def deciding(run: RunView, directory: str = "DIR") -> list[tuple[str, str]]:
    """The command that may decide what a run left open, and what it does: the two rewards train with seeds by which
    neither was chosen. Empty where nothing is open, or too many seeds would be needed.
    """
    config, left = run.config, _left_open(run, directory)
    if left is None:
        return []
    found, rewards = left
    usual = TrainConfig()
    repeated = {key: own for key in WORTH_REPEATING if (own := getattr(config, key)) != getattr(usual, key)}
    if found is not None and found.sure:
        return []
    seeds, effect = FEWEST, "train both with more seeds"
    if nothing_learnt(run):
        steps = config.steps or max(result.env_steps for result in run.results.values())
        repeated["steps"], effect = LONGER * steps, "train both for longer"
    elif found is not None:
        if found.seeds is None:
            return []
        seeds, effect = enough(found.seeds), "an even chance to decide it"
    settings = {
        "env": config.env,
        "reward": ",".join(rewards),
        **repeated,
        "seed": unused_seed(config),
        "seeds": seeds,
    }
    return [(command_line("train", *(f"{key}={value}" for key, value in settings.items())), effect)]


def _left_open(run: RunView, directory: str) -> tuple[Difference | None, tuple[str, str]] | None:
    """The difference between the two rewards that the verdict compares (None with one seed), and what `reward=` names
    them by. None where the verdict compares no rewards.
    """
    if run.searched:
        ended, own = run.outcome, run.best.program if run.best is not None else None
        if ended is None or own is None or not trained_baselines(run.config):
            return None
        if not (ended.method.scores and ended.human.scores):
            return None
        kept = "best" if run.fitted is None else f"candidates/{own.id}"  # else best/ holds another reward
        return ended.difference, ("human", f"{directory}/{kept}/reward.py")

    def file(name: str) -> str:
        return f"{directory}/candidates/{run.texts[name].id}/reward.py" if name in run.texts else name

    if run.tunes:
        found = run.tuned
        if found is None or not found.after or found.breach or found.breach_before:
            return None
        two, apart = (ORIGINAL, found.after), found.difference
        rewards = found.finals
    else:
        rewards = run.given
        if len(rewards) < 2:
            return None
        first, second = ordered(rewards)[:2]
        two, apart = (first, second), lead(rewards, first, second)
    if not all(rewards[name].scores for name in two):
        return None
    return apart, (file(two[0]), file(two[1]))
