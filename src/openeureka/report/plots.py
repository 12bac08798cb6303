"""Pictures of a search."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..config import short_name
from ..types import TrainingResult
from .stats import best_so_far
from .view import RunView

_BASELINE_STYLE = {"human": ("tab:green", "--"), "sparse": ("tab:gray", ":")}


def summary(run: RunView) -> bytes:
    """A PNG of three panels: the search, how the best reward's policy learnt, and the components of that reward."""
    figure = Figure(figsize=(15, 4.5), layout="constrained")
    search, learning, components = figure.subplots(1, 3)
    _search(search, run)
    result = run.best.result if run.best else None
    _learning(learning, result, run.baselines)
    _components(components, result)
    figure.suptitle(short_name(run.config.env))
    buffer = BytesIO()
    FigureCanvasAgg(figure).print_png(buffer)
    return buffer.getvalue()


def _search(axes: Axes, run: RunView) -> None:
    history = run.history
    points = [(g.index, e.score) for g in history.generations for e in g.entries if e.score is not None]
    axes.scatter([x for x, _ in points], [y for _, y in points], s=18, alpha=0.6, label="candidate")
    indices = [generation.index for generation in history.generations]
    axes.plot(indices, _gaps(best_so_far(history)), marker="o", markersize=4, label="best so far")
    for name in run.baselines:
        score = run.baseline_score(name)
        if score is not None:
            color, style = _BASELINE_STYLE.get(name, ("black", "--"))
            axes.axhline(score, color=color, linestyle=style, label=f"{name} reward")
    label = "F when played" if run.ranks == "played" else "F in training"
    axes.set(title="Search", xlabel="generation", ylabel=label, xticks=indices)
    axes.legend(fontsize="small")


def _learning(axes: Axes, best: TrainingResult | None, baselines: Mapping[str, TrainingResult]) -> None:
    if best is not None:
        axes.plot(_gaps(best.curves.get("fitness", ())), label="best reward")
    for name, result in baselines.items():
        color, style = _BASELINE_STYLE.get(name, ("black", "--"))
        axes.plot(_gaps(result.curves.get("fitness", ())), color=color, linestyle=style, label=f"{name} reward")
    axes.set(title="Training", xlabel="epoch", ylabel="F")
    if axes.lines:
        axes.legend(fontsize="small")


def _components(axes: Axes, best: TrainingResult | None) -> None:
    prefix = "component/"
    for name, values in best.curves.items() if best else ():
        if name.startswith(prefix):
            # Matplotlib reads `$` as mathematics and hides labels that begin with `_`.
            axes.plot(_gaps(values), label=" " + name.removeprefix(prefix).replace("$", r"\$"))
    axes.set(title="Components of the best reward", xlabel="epoch", ylabel="mean per step")
    if axes.lines:
        axes.legend(fontsize="small")


def _gaps(values: Sequence[float | None]) -> list[float]:
    """Undefined values as NaN, which is drawn as a gap."""
    return [float("nan") if value is None else value for value in values]
