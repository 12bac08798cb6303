"""What the curves of a training suggest, in sentences: where to look first, not what is proved."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..score import mean
from ..text import one_line
from ..types import TrainingResult
from .text import number

STILL = 1e-3
"""A component whose mean changes by less than this share of its largest size never moved."""
DOMINANT = 0.9
"""Of what all components pay together, a share that leaves the others no say."""
FALL = 0.2
"""Of the span of F: what it must lose after its peak, or gain in the last fifth, to be spoken of."""
LEAST = 20
"""Epochs below which a curve says too little."""

_PREFIX = "component/"
Curve = Sequence[float | None]


def hints(result: TrainingResult | None) -> tuple[str, ...]:
    """Sentences on a training, the gravest first; none of one that is too short to tell."""
    if result is None:
        return ()
    return (*_of_fitness(result), *_of_components(result))


def shares(result: TrainingResult | None) -> dict[str, float]:
    """What each component contributed: its part of all that they paid, by size, over the last tenth of the training."""
    curves = result.curves if result is not None else {}
    sizes = {
        one_line(name.removeprefix(_PREFIX), 60): abs(mean(_end(curve)) or 0.0)
        for name, curve in curves.items()
        if name.startswith(_PREFIX)
    }
    total = sum(sizes.values())
    return {name: size / total for name, size in sizes.items()} if total else {}


def _of_fitness(result: TrainingResult) -> Iterator[str]:
    fitness, own = result.curves.get("fitness", ()), result.curves.get("reward", ())
    defined = [value for value in fitness if value is not None]
    if len(defined) < LEAST:
        return
    span = max(defined) - min(defined)
    peak = fitness.index(max(defined))
    end = mean(_end(fitness))
    if span and end is not None and max(defined) - end > FALL * span and _rises(own, peak):
        yield (
            f"F falls while the own reward rises: {number(max(defined))} at epoch {peak}, {number(end)} at the end. "
            "The policy found something that the reward pays for and F does not."
        )
    before = mean(fitness[-len(fitness) // 5 : -len(fitness) // 10])
    if span and end is not None and before is not None and end - before > FALL * span / 2:
        yield "F still rises at the end: a longer training may show more (steps=)."
    if result.correlation is not None and result.correlation < 0.0:
        yield f"Its own reward and the human one run against each other (correlation {number(result.correlation, 2)})."


def _rises(own: Curve, since: int) -> bool:
    then, end = mean(own[max(0, since - 2) : since + 3]), mean(_end(own))
    return then is not None and end is not None and end > then


def _of_components(result: TrainingResult) -> Iterator[str]:
    named = {name: curve for name, curve in result.curves.items() if name.startswith(_PREFIX)}
    for name, curve in named.items():
        defined = [value for value in curve if value is not None]
        if len(defined) >= LEAST and max(defined) - min(defined) <= STILL * max(map(abs, defined)):
            yield f"`{one_line(name.removeprefix(_PREFIX), 60)}` never moved: it teaches nothing."
    found = shares(result)
    for name, share in found.items():
        if len(found) > 1 and share >= DOMINANT:
            yield f"`{name}` makes up {share:.0%} of what the components pay: the others hardly count."


def _end(curve: Curve) -> Curve:
    """The last tenth."""
    return curve[-max(1, len(curve) // 10) :]
