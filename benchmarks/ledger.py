"""How scripts of this folder train given rewards: in a run such as `eureka train` makes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from records import Record

from openeureka.cli.terminal import Terminal
from openeureka.config import RunConfig, TrainConfig
from openeureka.errors import EurekaError
from openeureka.method import given, hacking
from openeureka.method.lanes import Lanes
from openeureka.method.seeds import Wanted
from openeureka.report.build import build
from openeureka.runs.compose import comparing
from openeureka.runs.rewards import listed, named
from openeureka.tasks import registry
from openeureka.tasks.task import Recipe
from openeureka.types import Evaluation, Peak, TrainingResult, Tryout

Learned = dict[str, tuple[TrainingResult, Mapping[Peak, Evaluation]]]
"""Results without policies, and held-out scores of policies, by lane id."""
DEFAULTS = {
    field.name: field.default for field in dataclasses.fields(Recipe) if field.default is not dataclasses.MISSING
}
"""Defaults of a recipe. A record from before a field existed was made with its default."""


def whole(env: str, **changes: float) -> Record:
    """A task's recipe as JSON gives it back, with `changes` in place of its own values."""
    recipe = dataclasses.replace(registry.get(env).recipe, **changes)
    return {**dataclasses.asdict(recipe), "hidden": list(recipe.hidden)}


def differing(known: Record, wanted: Record) -> list[str]:
    """Fields of a recipe in which a record differs."""
    known = {**DEFAULTS, **known}
    return [word for word, value in wanted.items() if known[word] != value]


def refuse_other_recipe(entry: Record, wanted: Record, name: str) -> None:
    """Refuse to mix lanes of different recipes.

    Args:
        entry: what is known, empty where nothing is.

    Raises:
        SystemExit: where its `recipe` is another.
    """
    if entry and (words := differing(entry["recipe"], wanted)):
        raise SystemExit(f"The results hold {name} with another {' and '.join(words)}; remove it there to begin anew.")


class Script(Terminal):
    """The host of a run that a script trains in."""

    def begins(self, config: RunConfig, directory: Path) -> None:
        print(f"{config.env}, in {directory}")

    def again(self, directory: Path) -> str:
        return "the same command"


@contextmanager
def in_sentences() -> Iterator[None]:
    """Turns an error that a person can cause into a SystemExit with its text."""
    try:
        yield
    except EurekaError as error:
        raise SystemExit("\n".join([str(error), *getattr(error, "__notes__", ())])) from None


def learn(config: TrainConfig, peaks: Sequence[Peak], more: Iterable[Wanted] | None = None) -> Learned:
    """Train what the run in `config.dir` lacks, score these policies of every lane, and leave a report.

    Args:
        config: of the run; `eureka train` with the same settings goes on with it.
        peaks: policies that are scored, in the same held-out episodes as the one that stands for its lane.
        more: see `given.train`.

    Raises:
        SystemExit: with a sentence, where a person can do something about it.
    """
    directory = Path(config.dir)
    with in_sentences():
        with comparing(config.run_config(), directory, Script()) as lanes:
            given.keep(lanes.store, named(config, listed(config.reward)))
            given.train(lanes, more)
            lanes.store.end()
            scores, results = _held_out(lanes, peaks), lanes.store.lanes.results()
        build(directory, "none", config.env)
    return {lane: (result, scores.get(lane, {})) for lane, result in results.items()}


def _held_out(lanes: Lanes, peaks: Sequence[Peak]) -> dict[str, dict[Peak, Evaluation]]:
    """Scores by lane id and policy, as far as a lane has it."""
    log = lanes.store.lanes
    known = {(lane, score.peak): score for lane, score in log.evaluations().items()}
    others = [(lane, peak) for lane, _ in known for peak in peaks if (lane, peak) not in known]
    lanes.try_out(Tryout(lane=lane, name=hacking.PEAK_NAMES[peak], peak=peak) for lane, peak in others)
    tried = log.tryouts()
    found: dict[str, dict[Peak, Evaluation]] = {}
    for lane, peak in [*known, *others]:
        score = known.get((lane, peak)) or tried.get(lane, {}).get(hacking.PEAK_NAMES[peak])
        if peak is not None and score is not None:
            found.setdefault(lane, {})[peak] = score
    return found
