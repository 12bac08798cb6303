"""Curves as data for pictures that a page draws."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Literal

from ..config import short_name
from ..refine.hardened import Robust
from ..refine.tuned import ORIGINAL
from ..score import rank
from ..text import one_line
from ..types import TrainingResult, of_components
from ..types.dynamics import SCALES
from .candidates import CandidateView
from .hints import adds_up
from .view import RunView

MAX_POINTS = 150
"""Points kept of a longer curve: no screen shows more in the width of a chart."""
MAX_LINES = 12
"""Most lines of a chart: as many as there are colours."""
TOO_LARGE = 1e30
"""Values from here on are left out, like undefined ones: no axis could show them beside others."""
DIGITS = 5
"""Significant digits of a value; a report holds thousands of values."""
SPARK, SPARK_WIDTH, SPARK_HEIGHT = 40, 80.0, 20.0
"""Most points of a curve that is as small as a word, and its size [px]."""
BESIDE = {"human reward": 3, "sparse reward": 2}
"""Colours of the rewards that candidates are compared with; a candidate's own is 0."""

Curve = Sequence[float | None]
Point = tuple[float, float]
Kind = Literal["line", "dots", "dashed", "steps"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One curve over the x values of its chart."""

    name: str
    color: int
    """Number of a colour of the style sheet."""
    values: Curve
    kind: Kind = "line"


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """Lines over common x values."""

    title: str
    x_label: str
    xs: tuple[float, ...]
    lines: tuple[Line, ...]
    names: tuple[str, ...] = ()
    """Names of the xs, where these are candidates."""
    bounds: tuple[int, ...] = ()
    """The xs at which a generation begins."""
    note: str = ""


def carried(found: Robust) -> list[Chart]:
    """F over each quantity that was changed alone, before and after."""
    after = {one.name: one for one in found.after}
    drawn: list[Chart | None] = []
    for one in found.before:
        sweeps = [("before", 1, one), *([("after", 0, after[one.name])] if one.name in after else [])]
        lines = [Line(name=name, values=[F for _, F, _ in sweep.points], color=color) for name, color, sweep in sweeps]
        xs = [value for value, _, _ in one.points]
        drawn.append(_chart("F", f"{one.name} [{SCALES[one.name].unit}]", xs, lines))
    return [chart for chart in drawn if chart is not None]


# --- of a run ---------------------------------------------------------------------------------------------------------


def progress(run: RunView) -> Chart | None:
    """The score of every candidate in order, the best so far, and the rewards that came with the task."""
    shown = run.candidates
    scores = [candidate.score for candidate in shown]
    early = any(candidate.played is None and candidate.score is not None for candidate in shown)
    levels = {f"{name} reward": run.baseline_score(name) for name in run.baselines}
    lines = [
        Line(name="candidate", values=scores, color=0, kind="dots"),
        Line(name="best so far", values=_best_so_far(run), color=0, kind="steps"),
        *(
            Line(name=name, values=[value] * len(shown), color=BESIDE[name], kind="dashed")
            for name, value in levels.items()
        ),
    ]
    begins = [index for index, candidate in enumerate(shown) if not index or candidate.slot < shown[index - 1].slot]
    return _chart(
        "F when played" if run.ranks == "played" else "F in training",
        "candidate",
        range(len(shown)),
        lines,
        names=tuple(str(candidate.place) for candidate in shown),
        bounds=tuple(begins),
        note="Candidates not yet played are at their F in training." if run.ranks == "played" and early else "",
    )


def learning(candidate: CandidateView, baselines: Mapping[str, TrainingResult]) -> Chart | None:
    """F during the candidate's training, with the curves of the baselines."""
    if candidate.result is None:
        return None
    curves = {"this reward": candidate.result.curves.get("fitness", ())}
    curves |= {f"{name} reward": result.curves.get("fitness", ()) for name, result in baselines.items()}
    return _curves("F in training", curves, beside=BESIDE)


def trainings(run: RunView) -> Chart | None:
    """F during several trainings, by name; for a tuning, only the final ones as soon as there are any."""
    finals = [lane for lane in run.lanes.values() if lane.role == "final" and lane.id in run.results]
    called = {own.id: "before" if name == ORIGINAL else name for name, own in run.texts.items()}
    names = {lane.id: f"{called.get(lane.reward, lane.reward)}, seed {lane.seed}" for lane in finals}
    shown = names if run.tunes and names else {lane: lane for lane in run.results}
    curves = {name: run.results[lane].curves.get("fitness", ()) for lane, name in shown.items()}
    return _curves("F in training, with noise on the actions", curves, "trainings")


def components(result: TrainingResult | None) -> Chart | None:
    """Each component's mean per step."""
    named = of_components(result.curves) if result is not None else {}
    drawn = _curves("Components, mean per step", named, "components")
    if drawn is None or adds_up(result):
        return drawn
    return replace(drawn, note=f"The components do not add up to the reward. {drawn.note}".rstrip())


def under_way(
    xs: Sequence[float], curves: Mapping[str, Curve], title: str = "F of every lane as it trains"
) -> Chart | None:
    """Curves of lanes that are being trained, by epoch."""
    return _chart(title, "epoch", xs, _lines(curves), note=_undrawn(len(curves), "lines"))


def best_by_candidate(runs: Mapping[str, RunView]) -> list[Chart]:
    """The best score so far of several searches, over the number of candidates drawn. Each task with two or more of the
    searches has its own chart, because its F has its own scale."""
    charts = []
    tasks = Counter(run.config.env for run in runs.values())
    for env in (env for env, count in tasks.items() if count > 1):
        curves = {name: _best_so_far(run) for name, run in runs.items() if run.config.env == env}
        most = max(map(len, curves.values()), default=0)
        lines = _lines({name: (*curve, *[None] * (most - len(curve))) for name, curve in curves.items()}, kind="steps")
        title, note = f"{short_name(env)}: best F so far", _undrawn(len(curves), "runs")
        charts.append(_chart(title, "candidates drawn", range(1, most + 1), lines, note=note))
    return [chart for chart in charts if chart is not None]


def _best_so_far(run: RunView) -> tuple[float | None, ...]:
    """After each candidate, the highest score so far of those that may win."""
    limits = run.config.cost_limits
    lost = (own.vetoed or (own.played is not None and own.played.broken(limits)) for own in run.candidates)
    scores = [None if out else own.score for out, own in zip(lost, run.candidates, strict=True)]
    return tuple(value if math.isfinite(value) else None for value in accumulate(map(rank, scores), max))


def spending(title: str, lines: Mapping[str, Sequence[Point]], levels: Mapping[str, float]) -> Chart | None:
    """What was reached over environment steps, as step curves, and levels to compare with. None where all points lie at
    one number of steps.

    Args:
        lines: by name, pairs of environment steps and the value from there on, in order. Colours follow the order.
        levels: by name, a value that took no steps.
    """
    xs = sorted({steps for points in lines.values() for steps, _ in points})
    if len(xs) < 2:
        return None
    drawn = [
        Line(name=name, values=_reached(points, xs), color=color % MAX_LINES, kind="steps")
        for color, (name, points) in enumerate(lines.items())
    ]
    drawn += [
        Line(name=name, values=[value] * len(xs), color=color % MAX_LINES, kind="dashed")
        for color, (name, value) in enumerate(levels.items(), start=len(lines))
    ]
    return _chart(title, "million environment steps", [steps / 1e6 for steps in xs], drawn)


def _reached(points: Sequence[Point], xs: Iterable[float]) -> list[float | None]:
    return [next((value for steps, value in reversed(points) if steps <= place), None) for place in xs]


def spark(curve: Curve) -> str:
    """The points of a polyline as small as a word; empty for a curve without two defined values."""
    kept = [(x, value) for x in _kept(len(curve), SPARK) if (value := drawable(curve[x])) is not None]
    if len(kept) < 2:
        return ""
    low, high = min(value for _, value in kept), max(value for _, value in kept)
    last, span = kept[-1][0] or 1, (high - low) or 1.0
    return " ".join(
        f"{1 + x / last * (SPARK_WIDTH - 2):.1f},{SPARK_HEIGHT - 1 - (value - low) / span * (SPARK_HEIGHT - 2):.1f}"
        for x, value in kept
    )


# --- curves to charts -------------------------------------------------------------------------------------------------


def _curves(title: str, curves: Mapping[str, Curve], what: str = "", beside: Mapping[str, int] = {}) -> Chart | None:
    """Curves over epochs, all thinned to the same epochs."""
    drawn = dict(list(curves.items())[:MAX_LINES])
    longest = max(map(len, drawn.values()), default=0)
    xs = sorted({*_kept(longest), *(len(curve) - 1 for curve in drawn.values() if curve)})
    thinned = {name: [curve[x] if x < len(curve) else None for x in xs] for name, curve in drawn.items()}
    return _chart(title, "epoch", xs, _lines(thinned, beside), note=_undrawn(len(curves), what))


def _kept(length: int, most: int = MAX_POINTS) -> list[int]:
    """Indices that are kept of a curve: every n-th and the last."""
    kept = [*range(0, length, max(1, math.ceil(length / most)))]
    return kept if not kept or kept[-1] == length - 1 else [*kept, length - 1]


def _lines(curves: Mapping[str, Curve], beside: Mapping[str, int] = {}, kind: Kind = "line") -> list[Line]:
    """A line for each curve; those in `beside`, to compare with, are dashed and in their own colours."""
    return [
        Line(name=name, values=values, color=beside.get(name, color), kind="dashed" if name in beside else kind)
        for color, (name, values) in enumerate(list(curves.items())[:MAX_LINES])
    ]


def _rounded(values: Iterable[float | None]) -> tuple[float | None, ...]:
    return tuple(float(f"{v:.{DIGITS}g}") if (v := drawable(value)) is not None else None for value in values)


def drawable(value: float | None) -> float | None:
    """None also for a value that no axis could show beside others."""
    return value if value is not None and abs(value) < TOO_LARGE else None


def _undrawn(count: int, what: str) -> str:
    return f"{count - MAX_LINES} more {what} are not drawn." if count > MAX_LINES else ""


def _chart(
    title: str,
    x_label: str,
    xs: Iterable[float],
    lines: Iterable[Line],
    *,
    names: tuple[str, ...] = (),
    bounds: tuple[int, ...] = (),
    note: str = "",
) -> Chart | None:
    """The chart of those lines that have a value; None without any. Names are made safe to show, values rounded."""
    shown = (replace(line, name=one_line(line.name, 60), values=_rounded(line.values)) for line in lines)
    defined = tuple(line for line in shown if any(value is not None for value in line.values))
    if not defined:
        return None
    return Chart(title=title, x_label=x_label, xs=tuple(xs), lines=defined, names=names, bounds=bounds, note=note)
