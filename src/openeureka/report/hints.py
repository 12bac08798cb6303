"""What the curves of a training suggest, in sentences: where to look first, not what is proved."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..numbers import number
from ..stats import mean
from ..text import one_line
from ..types import TrainingResult, of_components

STILL = 1e-3
"""A component whose mean changes by less than this share of its largest size never moved."""
DOMINANT = 0.9
"""Share of what all components pay that leaves the others no say."""
FALL = 0.2
"""Share of the span of F that F must lose after its peak for a hint, or gain in a fifth of the training at its last
pace."""
UNACCOUNTED = 0.05
"""Share of the reward at the end by which the sum of its components may miss it."""
WORTH = 0.1
"""Share of the best F: a span of F below it counts as noise."""
LEAST = 20
"""Epochs below which a curve says too little."""

Curve = Sequence[float | None]


def hints(result: TrainingResult | None, best: float | None = None) -> tuple[str, ...]:
    """Sentences on a training, the most serious first; none on a training that is too short.

    Args:
        best: the highest F of the run, to tell a fall from noise; None where none is known.
    """
    if result is None:
        return ()
    return (*_of_fitness(result, abs(best or 0.0)), *_of_components(result))


def shares(result: TrainingResult | None) -> dict[str, float]:
    """Share of each component in what all components paid, by absolute value, over the last tenth of the training.
    Empty where they do not add up to the reward, as factors of a product or terms without their weights."""
    ends = _ends(result)
    total = sum(map(abs, ends.values()))
    return {name: abs(end) / total for name, end in ends.items()} if total and adds_up(result) else {}


def adds_up(result: TrainingResult | None) -> bool:
    """Whether the components are the terms of a sum that is the reward; true where the reward is not known."""
    reward = mean(_end(result.curves.get("reward", ()))) if result is not None else None
    return reward is None or abs(sum(_ends(result).values()) - reward) <= UNACCOUNTED * abs(reward)


def _ends(result: TrainingResult | None) -> dict[str, float]:
    """The mean of each component over the last tenth of the training."""
    named = of_components(result.curves) if result is not None else {}
    return {one_line(name, 60): mean(_end(curve)) or 0.0 for name, curve in named.items()}


def _of_fitness(result: TrainingResult, best: float) -> Iterator[str]:
    fitness, own = result.curves.get("fitness", ()), result.curves.get("reward", ())
    defined = [value for value in fitness if value is not None]
    if len(defined) < LEAST:
        return
    span = max(defined) - min(defined)
    span = span if span >= WORTH * best else 0.0
    peak = fitness.index(max(defined))
    end = mean(_end(fitness))
    if span and end is not None and max(defined) - end > FALL * span and _rises(own, peak):
        yield (
            f"F fell from {number(max(defined))} at epoch {peak} to {number(end)} while the reward kept rising: the "
            "policy may exploit the reward."
        )
    before = mean(fitness[-len(fitness) // 5 : -len(fitness) // 10])
    if span and end is not None and before is not None and end - before > FALL * span / 2:
        yield "F still rises at the end: a longer training may show more (steps=)."
    if result.correlation is not None and result.correlation < 0.0:
        yield f"This reward and the human one are negatively correlated ({number(result.correlation, 2)})."


def _rises(own: Curve, since: int) -> bool:
    then, end = mean(own[max(0, since - 2) : since + 3]), mean(_end(own))
    return then is not None and end is not None and end > then


def _of_components(result: TrainingResult) -> Iterator[str]:
    for name, curve in of_components(result.curves).items():
        defined = [value for value in curve if value is not None]
        if len(defined) >= LEAST and max(defined) - min(defined) <= STILL * max(map(abs, defined)):
            yield _still(one_line(name, 60), defined[-1])
    found = shares(result)
    for name, share in found.items():
        if len(found) > 1 and share >= DOMINANT:
            yield f"{name} makes up {share:.0%} of what the components pay: the others hardly count."


def _still(name: str, value: float) -> str:
    """On a component that pays the same at every step: it makes a longer episode worth more, or less."""
    if not value:
        return f"{name} was always 0: it teaches nothing."
    return f"{name} stayed at {number(value)}: it only rewards or punishes long episodes."


def _end(curve: Curve) -> Curve:
    """The last tenth of a curve."""
    return curve[-max(1, len(curve) // 10) :]
