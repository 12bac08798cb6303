"""Curves as data for small SVG pictures: scaled, thinned, and with round numbers on the axes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from ..types import TrainingResult
from .tables import best_so_far
from .text import number
from .view import CandidateView, RunView

WIDTH, HEIGHT = 420, 190
LEFT, RIGHT, TOP, BOTTOM = 52, 8, 8, 22
MAX_POINTS = 150
"""Points drawn of a longer curve: no screen shows more in this width."""
MAX_LINES = 12
TOO_LARGE = 1e30
"""Values from here on are left out, like undefined ones: no axis could show them beside others."""
_FLAT = 1e-9
"""A range this small beside its values is drawn as a level line."""

Curve = Sequence[float | None]
Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Tick:
    """A mark on an axis."""

    place: float
    """[px]"""
    label: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One curve, or with `dots` one cloud of points; in pixels."""

    name: str
    color: int
    """Number of a colour of the style sheet."""
    pieces: tuple[tuple[Point, ...], ...]
    """Broken where the curve is undefined."""
    dots: bool = False
    dashed: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """Lines over a pair of axes, in pixels."""

    title: str
    x_label: str
    lines: tuple[Line, ...]
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    note: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Series:
    """A line before it is scaled."""

    name: str
    points: tuple[tuple[float, float | None], ...]
    color: int
    dots: bool = False
    dashed: bool = False


def progress(run: RunView) -> Chart | None:
    """F of every candidate by generation, the best so far, and the rewards that came with the task."""
    dots = tuple((float(c.generation), c.score) for c in run.candidates if c.score is not None)
    best = tuple((float(index), value) for index, value in enumerate(best_so_far(run.history)))
    scores = {name: run.baseline_score(name) for name in run.baselines}
    last = float(max(1, len(run.generations) - 1))
    series = [
        _Series(name="candidate", points=dots, color=0, dots=True),
        _Series(name="best so far", points=best, color=0),
        *(
            _Series(name=f"{name} reward", points=((0.0, score), (last, score)), color=color, dashed=True)
            for color, (name, score) in enumerate(scores.items(), start=1)
        ),
    ]
    title = "F when played" if run.ranks == "played" else "F in training"
    return _chart(f"{title}, every candidate", "generation", series)


def learning(candidate: CandidateView, baselines: Mapping[str, TrainingResult]) -> Chart | None:
    """F during the candidate's training, beside the other rewards'."""
    if candidate.result is None:
        return None
    own = _Series(name="this reward", points=_points(candidate.result.curves.get("fitness", ())), color=0)
    others = [
        _Series(name=f"{name} reward", points=_points(result.curves.get("fitness", ())), color=color, dashed=True)
        for color, (name, result) in enumerate(baselines.items(), start=1)
    ]
    return _chart("F in training", "epoch", [own, *others])


def trainings(results: Mapping[str, TrainingResult]) -> Chart | None:
    """F during several trainings, by name."""
    series = [
        _Series(name=name, points=_points(result.curves.get("fitness", ())), color=color)
        for color, (name, result) in enumerate(list(results.items())[:MAX_LINES])
    ]
    return _chart("F in training", "epoch", series, _undrawn(len(results), "trainings"))


def components(result: TrainingResult | None) -> Chart | None:
    """Each component's mean per step."""
    prefix = "component/"
    curves = result.curves if result is not None else {}
    names = [name for name in curves if name.startswith(prefix)]
    series = [
        _Series(name=name.removeprefix(prefix), points=_points(curves[name]), color=color)
        for color, name in enumerate(names[:MAX_LINES])
    ]
    return _chart("Components, mean per step", "epoch", series, _undrawn(len(names), "components"))


def spending(title: str, lines: Mapping[str, Sequence[Point]], levels: Mapping[str, float]) -> Chart | None:
    """Steps up of what was reached by environment steps, and levels to compare with.

    Args:
        lines: by name, environment steps and the value from there on, in order; in the colours of their places.
        levels: by name, a value that needed none.
    """
    last = max((steps for points in lines.values() for steps, _ in points), default=0.0) / 1e6
    series = [
        _Series(name=name, points=_stairs(points, last), color=color % MAX_LINES)
        for color, (name, points) in enumerate(lines.items())
    ]
    series += [
        _Series(name=name, points=((0.0, value), (last, value)), color=2, dashed=True) for name, value in levels.items()
    ]
    return _chart(title, "million environment steps", series, whole=False) if last else None


def _stairs(points: Sequence[Point], last: float) -> tuple[tuple[float, float | None], ...]:
    """Both ends of each step, in millions; the last one's is that of the picture."""
    ends = [*(steps / 1e6 for steps, _ in points[1:]), last]
    return tuple((x, value) for (steps, value), end in zip(points, ends, strict=False) for x in (steps / 1e6, end))


def _undrawn(count: int, what: str) -> str:
    return f"{count - MAX_LINES} more {what} are not drawn." if count > MAX_LINES else ""


def _points(curve: Curve) -> tuple[tuple[float, float | None], ...]:
    """Epoch and value; of a long curve every n-th and the last."""
    stride = max(1, math.ceil(len(curve) / MAX_POINTS))
    kept = [*range(0, len(curve), stride)]
    if kept and kept[-1] != len(curve) - 1:
        kept.append(len(curve) - 1)
    return tuple((float(epoch), _drawable(curve[epoch])) for epoch in kept)


def _drawable(value: float | None) -> float | None:
    return value if value is not None and abs(value) < TOO_LARGE else None


def _chart(title: str, x_label: str, series: Sequence[_Series], note: str = "", *, whole: bool = True) -> Chart | None:
    """The chart; None when no value is defined.

    Args:
        whole: whether x counts something.
    """
    defined = [(x, y) for one in series for x, y in one.points if y is not None]
    if not defined:
        return None
    xs, ys = _axis([x for x, _ in defined], whole=whole), _axis([y for _, y in defined])
    lines = tuple(
        Line(name=one.name, color=one.color, pieces=_pieces(one.points, xs, ys), dots=one.dots, dashed=one.dashed)
        for one in series
    )
    return Chart(
        title=title,
        x_label=x_label,
        lines=tuple(line for line in lines if line.pieces),
        x_ticks=tuple(Tick(_x(value, xs), number(value)) for value in xs),
        y_ticks=tuple(Tick(_y(value, ys), number(value)) for value in ys),
        note=note,
    )


def _pieces(
    points: Iterable[tuple[float, float | None]], xs: Sequence[float], ys: Sequence[float]
) -> tuple[tuple[Point, ...], ...]:
    pieces: list[list[Point]] = [[]]
    for x, y in points:
        if y is None:
            pieces.append([])
        else:
            pieces[-1].append((_x(x, xs), _y(y, ys)))
    return tuple(tuple(piece) for piece in pieces if piece)


def _axis(values: Sequence[float], *, whole: bool = False) -> list[float]:
    """Three to six equidistant round numbers that span the values."""
    low, high = min(values), max(values)
    size = max(abs(low), abs(high))
    if high - low <= _FLAT * size or size < 1 / TOO_LARGE:
        margin = 0.5 * size if size > 1 / TOO_LARGE else 1.0
        low, high = (low, high + 1) if whole else (low - margin, high + margin)
    step = _round_up((high - low) / 4)
    step = max(1.0, step) if whole else step
    first, last = math.floor(low / step), math.ceil(high / step)
    return [step * index for index in range(first, last + 1)]


def _round_up(value: float) -> float:
    """The next of 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= value * (1 - 1e-9))


def _x(value: float, axis: Sequence[float]) -> float:
    return round(LEFT + (value - axis[0]) / (axis[-1] - axis[0]) * (WIDTH - LEFT - RIGHT), 1)


def _y(value: float, axis: Sequence[float]) -> float:
    return round(HEIGHT - BOTTOM - (value - axis[0]) / (axis[-1] - axis[0]) * (HEIGHT - TOP - BOTTOM), 1)
