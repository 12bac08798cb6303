"""The pictures of measurements in the documentation, as SVG, from the same JSON as the tables beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import StringIO
from typing import Any

import matplotlib as mpl

mpl.use("svg")
from matplotlib.axes import Axes
from matplotlib.figure import Figure

STYLE = {
    "svg.hashsalt": "openeureka",  # with no date below: equal measurements make equal files
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "legend.frameon": False,
}
COLOURS = {"plain": "#888888", "longer": "#5aa469", "uniform": "#d98b2b", "ours": "#1f6fb2"}
ENDINGS = {"better": "#1f6fb2", "worse": "#b03a2e", "level": "#888888", "too few seeds": "#d2d2d2"}
Record = Mapping[str, Any]


def robust(shown: Mapping[str, Mapping[str, Record]]) -> str:
    """F of the policies in their own world and in each hard one: a point per seed, a line through the means."""
    figure = _figure(9.0, 2.6 * max(1, len(shown)))
    for row, (task, measured) in enumerate(shown.items()):
        axes = figure.add_subplot(len(shown), 1, row + 1)
        seeds = [seed["arms"] for seed in measured.values()]
        worlds = ["own world", *seeds[0]["plain"]["worlds"]]
        for arm, colour in COLOURS.items():
            if any(arm not in seed for seed in seeds):
                continue
            scores = [[seed[arm]["nominal"], *seed[arm]["worlds"].values()] for seed in seeds]
            for found in scores:
                axes.plot(range(len(worlds)), found, "o", color=colour, markersize=3.0, alpha=0.5)
            means = [sum(column) / len(column) for column in zip(*scores, strict=True)]
            axes.plot(range(len(worlds)), means, "-", color=colour, label=arm)
        axes.set_xticks(range(len(worlds)), [world.replace(", ", ",\n") for world in worlds], rotation=30, ha="right")
        axes.set_title(f"{task}, {len(seeds)} seed{'s' * (len(seeds) > 1)}", loc="left")
        axes.set_ylabel("F, held out")
        axes.legend(ncols=len(COLOURS), loc="lower right", bbox_to_anchor=(1.0, 1.0))
    return _svg(figure)


def correlations(
    rows: Sequence[tuple[str, str, Sequence[float | None]]], shares: Sequence[float], title: str, of: str
) -> str:
    """How a rank correlation rises with the share of a training: rows of task, panel and a value per share."""
    panels = list(dict.fromkeys(panel for _, panel, _ in rows))
    figure = _figure(8.0, 3.0)
    for place, panel in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), place + 1)
        for task, own, values in rows:
            if own == panel:
                axes.plot(shares, [float("nan") if value is None else value for value in values], "o-", label=task)
        axes.axhline(0.0, color="#444444", linewidth=0.8)
        axes.set_ylim(-1.0, 1.05)
        axes.set_title(title.format(panel), loc="left")
        axes.set_xlabel("share of the training")
        if not place:
            axes.set_ylabel(of)
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside right center")
    return _svg(figure)


def bars(rows: Sequence[tuple[str, str, float, float, float]]) -> str:
    """Rows of task, how it ended, and how much more the generated reward's F is than the human one's, as a share of the
    larger, with both ends of its interval."""
    figure = _figure(8.0, 0.6 + 0.34 * len(rows))
    axes = figure.add_subplot()
    for place, (_, ending, value, low, high) in enumerate(rows):
        axes.barh(place, value, color=ENDINGS[ending], height=0.6)
        axes.plot([low, high], [place, place], "-", color="#222222", linewidth=1.0)
        axes.plot(value, place, "o", color="#222222", markersize=4.0)  # a bar of zero length cannot be seen
    axes.axvline(0.0, color="#222222", linewidth=1.0)
    axes.set_xlim(-1.5, 1.5)  # an interval of three seeds can be ten times as wide, and would flatten all others
    axes.set_yticks(range(len(rows)), [task for task, *_ in rows])
    axes.invert_yaxis()
    axes.set_xlabel("F of the generated reward less that of the human one, held out, as a share of the larger")
    _free(axes)
    return _svg(figure)


def novelty(rows: Sequence[tuple[str, str, float, float]]) -> str:
    """Rows of task, how it ended, correlation of the generated reward with the human one, and difference in half
    intervals."""
    figure = _figure(8.0, 3.6)
    axes = figure.add_subplot()
    for _, ending, correlation, halves in rows:
        axes.plot(correlation, halves, "o", color=ENDINGS[ending])
    low, high = axes.get_ylim()
    line, names = (high - low) / 18, list[tuple[float, float, float]]()
    for task, _, correlation, halves in sorted(rows, key=lambda row: row[-1]):
        if abs(halves) > 1.0:  # the names of all would cover each other
            right = correlation - 0.025
            left = right - 0.022 * len(task)  # a little more than it takes
            above = max([halves, *(y + line for begin, end, y in names if begin < right and left < end)])
            axes.text(right, above, task, ha="right", va="center")
            names.append((left, right, above))
    for level in (-1.0, 0.0, 1.0):
        axes.axhline(level, color="#444444", linewidth=0.8, linestyle="-" if level == 0.0 else ":")
    axes.set_xlim(-1.05, 1.05)
    axes.set_xlabel("correlation of the generated reward with the human one")
    axes.set_ylabel("difference in F, in halves\nof its 95 % interval")
    return _svg(figure)


def _free(axes: Axes) -> None:
    axes.grid(visible=False, axis="y")
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)


def _figure(width: float, height: float) -> Figure:
    mpl.rcParams.update(STYLE)
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def _svg(figure: Figure) -> str:
    text = StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return "".join(f"{line.rstrip()}\n" for line in text.getvalue().splitlines())
