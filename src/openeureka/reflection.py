"""Reward reflection: what a training tells about its reward, as text for the model that wrote it. Pure functions.

The form is that of Eureka (arXiv 2310.12931, section 3.3): about ten points of every component's curve with its
extremes, the task's score and the length of the episodes, and how to read them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal

from .types import Evaluation, Sample, TrainingResult, TrainingState

Style = Literal["free", "grammar"]
Curves = Mapping[str, Sequence[float | None]]

_INTRODUCTION = """\
A policy was trained with this reward function. Every {interval} epochs the means of its components, the score of the \
task and the length of the episodes [steps] were:"""

_TIPS = """\
Read these numbers before you write the improved reward function:
(1) If the task score stays near where it began, the reward does not lead to the task: write all of it anew.
(2) If a component hardly changes during training, the policy cannot influence it as it stands: change its scale or \
its temperature, write it in another way, or drop it.
(3) If a component is far larger than the others, they do not count beside it: bring it to their size.
(4) If the task score falls while a component rises, that component pays for something else than the task.
Go through the components one by one, then write the improved reward function."""


def reflect(sample: Sample, result: TrainingResult | None, style: Style, played: Evaluation | None = None) -> str:
    """Feedback on one slot: the findings where its program was refused, else what its training showed.

    The style `grammar` is for small models: fewer points, shorter numbers, no advice.
    """
    if result is None:
        return refusal(sample)
    if result.state is TrainingState.FAILED:
        return "No policy could be trained with this reward function."  # the reason is about this machine, not for it
    if style == "grammar":
        return "\n".join(
            [*_ending(result), *summary(result.curves, points=4, brief=True), *_played(played, brief=True)]
        )
    introduction = _INTRODUCTION.format(interval=_interval(result.curves, points=10))
    lines = [*_ending(result), introduction, *summary(result.curves, points=10), *_played(played)]
    return "\n".join([*lines, "", _TIPS])


def refusal(sample: Sample) -> str:
    """Why the program never trained."""
    reasons = [f"- {finding.sentence()}" for finding in sample.verdict.findings]
    return "\n".join(["The reward function could not be used:", *(reasons or [f"- {sample.verdict.code}"])])


def summary(curves: Curves, *, points: int, brief: bool = False) -> list[str]:
    """A line for each component, then the task score and the episode length. Undefined epochs read `none`."""
    shown = {name.removeprefix("component/"): curve for name, curve in curves.items() if name.startswith("component/")}
    shown["task_score"] = curves.get("fitness", ())
    shown["episode_length"] = curves.get("episode_length", ())
    interval = _interval(curves, points)
    return [_line(name, curve, interval, brief) for name, curve in shown.items()]


def _played(score: Evaluation | None, brief: bool = False) -> list[str]:
    """A line on the number that ranks; nothing where training ranks."""
    if score is None:
        return []
    error = f" ± {_number(score.error, brief)}" if score.error is not None else ""
    return [
        f"final task_score, of the trained policy without exploration noise in {score.episodes} new episodes: "
        f"{_number(score.fitness, brief)}{error}"
    ]


def _ending(result: TrainingResult) -> list[str]:
    """A sentence for a training that was stopped."""
    if result.state is TrainingState.FINISHED:
        return []
    reason = f" ({result.message})" if result.message else ""
    return [f"The training was stopped early{reason}: keep every part of the reward finite and of moderate size."]


def _interval(curves: Curves, points: int) -> int:
    """Epochs from one shown point to the next, as published: a `points`-th of the training."""
    return max(max(map(len, curves.values()), default=0) // points, 1)


def _line(name: str, curve: Sequence[float | None], interval: int, brief: bool) -> str:
    """`name: [first, ..., last], Max: , Mean: , Min: ` with the extremes over all epochs, not only those shown."""
    series = ", ".join(_number(value, brief) for value in curve[::interval])
    defined = [value for value in curve if value is not None and math.isfinite(value)]
    if not defined:
        return f"{name}: [{series}]"
    high, mean, low = max(defined), math.fsum(defined) / len(defined), min(defined)
    return f"{name}: [{series}], " + ", ".join(
        f"{word}: {_number(value, brief)}" for word, value in (("Max", high), ("Mean", mean), ("Min", low))
    )


def _number(value: float | None, brief: bool) -> str:
    """Two decimals (one when brief), but two significant digits for what those would round away."""
    if value is None or not math.isfinite(value):
        return "none"
    if 0 < abs(value) < 0.1:
        return f"{value:.2g}"
    return f"{value:.1f}" if brief else f"{value:.2f}"
