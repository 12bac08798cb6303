"""What fitting the numbers of a reward found, as tables."""

from __future__ import annotations

from ..numbers import number, spread
from ..refine.tuned import ORIGINAL, Correlation, Effect, Tuned
from .tables import NOISY, Table
from .view import RunView


def finals(run: RunView, found: Tuned) -> Table:
    """A row for each weighting that trained with fresh seeds."""
    names = {ORIGINAL: "before", found.after: f"after ({found.after})"}
    rows = [
        (names.get(name, name), spread(own.training), spread(own.held_out), str(len(own.training)))
        for name, own in found.finals.items()
    ]
    note = "Mean ± standard deviation over fresh seeds."
    if run.noisy:
        note += f" Held out: {NOISY}."
    if any(own.scores for own in found.finals.values()):
        note += f" best/ holds the {'original' if found.better == ORIGINAL else 'tuned'} reward."
    return Table(("numbers", "F in training", "F held out", "seeds"), rows, note)


def numbers(found: Tuned) -> Table:
    """A row for each number that was fitted: before, after, and what it does to F."""
    rows = [
        (
            effect.weight.name,
            number(effect.weight.value),
            number(effect.after),
            _correlation(effect.trend),
            _correlation(effect.distance),
            _effect(effect),
        )
        for effect in found.effects
    ]
    note = (
        f"Rank correlations of F when played with each number, and with its distance from its value before, over "
        f"{found.trained} trainings. For each number both intervals hold together with 95 %: of twenty numbers that "
        "do not matter, about one will seem to. Thresholds were changed a tenth as much as the other numbers."
    )
    return Table(("number", "before", "after", "F with a larger value", "F with a larger change", "effect"), rows, note)


def _correlation(found: Correlation | None) -> str:
    return f"{found.value:+.2f} ({found.low:+.2f} to {found.high:+.2f})" if found is not None else "-"


def _effect(effect: Effect) -> str:
    """What can be said of a number, in words."""
    if effect.trend is None and effect.distance is None:
        return "too few trainings to tell"
    said: list[str] = []
    if effect.trend is not None and effect.trend.sure:
        said.append("more is better" if effect.trend.value > 0 else "less is better")
    if effect.distance is not None and effect.distance.sure:
        said.append("better when changed" if effect.distance.value > 0 else "better unchanged")
    return ", ".join(said) or "no effect seen"


def components(found: Tuned) -> Table:
    """Mean of each component with the numbers before and after."""
    rows = [(name, number(before), number(after)) for name, (before, after) in found.components.items()]
    note = "Mean per step in the last tenth of the final trainings, each with its own numbers."
    return Table(("component", "before", "after"), rows, note)


def trials(found: Tuned) -> Table:
    """A row for each weighting, as they were proposed, and a column for each number."""
    rows = [
        (trial.name, number(trial.played), trial.candidate.id, *(number(value) for value in trial.values))
        for trial in found.trials
    ]
    names = (effect.weight.name for effect in found.effects)
    return Table(("weighting", "F when played", "program", *names), rows)
