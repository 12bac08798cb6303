"""What a training tells about its reward, as text for the model that wrote it: reward reflection. Pure functions.

The form is that of Eureka (arXiv 2310.12931, section 3.3): about ten points of every component's curve with its
extremes, the task's score and the length of the episodes. How to use them is said once, at the end of the prompt.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ..config import RunConfig
from ..stats import defined, mean
from ..types import (
    Evaluation,
    Limits,
    Sample,
    Scored,
    Style,
    TrainingResult,
    TrainingState,
    VerdictCode,
    lane_id,
    of_components,
)

Curves = Mapping[str, Sequence[float | None]]

_INTRODUCTION = """\
A policy was trained with this reward function for {epochs} epochs{staged}. Each list begins with the first epoch and \
has a value every {interval} epochs; Max, Mean and Min are over all of them. A component's value is its mean over all \
steps and environments of the epoch. task_score is the score of the policy in training, while it explored{averaged}\
{late}{ranks}. episode_length is the mean of the episodes that ended in the epoch alone, at times a single one \
[steps]."""
_EARLY_AND_LATE = (
    "At the end of training, in the first quarter of a full episode, then in the rest (none: no episode lasted so long)"
)
_MEASURED = {"task_score": "fitness", "episode_length": "episode_length"}
"""Measured curves that the feedback shows with the components, by their names there."""


def scored(
    config: RunConfig,
    samples: Sequence[Sample],
    results: Mapping[str, TrainingResult],
    scores: Mapping[str, Evaluation],
    *,
    style: Style,
    window: int,
) -> list[Scored]:
    """Every slot of a generation with its training and played score, by lane id, if any, and the feedback on it."""
    entries: list[Scored] = []
    for sample in samples:
        lane = lane_id(sample.verdict.candidate, config.seed)
        result, played = results.get(lane), scores.get(lane)
        feedback = reflect(sample, result, style, played, config.cost_limits, window)
        entries.append(Scored(sample=sample, result=result, played=played, feedback=feedback))
    return entries


def reflect(
    sample: Sample,
    result: TrainingResult | None,
    style: Style,
    played: Evaluation | None,
    limits: Limits,
    window: int = 1,
) -> str:
    """Feedback on one slot: the findings where its program was refused, else what its training showed.

    The style `grammar` is for small models: fewer points, shorter numbers, no explanation.

    Args:
        played: score of the policy when played, if that ranks candidates. The prompt states the score itself, as those
            that lead play more episodes later.
        limits: the most that the policy may cost.
        window: epochs over which the score in training is averaged.
    """
    if result is None:
        return refusal(sample)
    if result.state is TrainingState.FAILED:
        return "\n".join(_ending(result))
    if style == "grammar":
        staged = [f"The lists are of its last epochs{_staged(result)}."] if result.steps_before else []
        told = summary(result.curves, points=4, brief=True)
        return "\n".join([*_ending(result), *staged, *told, *_costs(played, limits)])
    introduction = _INTRODUCTION.format(
        epochs=_epochs(result.curves),
        staged=_staged(result),
        interval=_interval(result.curves, points=10),
        averaged=f", averaged over the last {window} epochs" if window > 1 else "",
        late=" (none: too early to tell)" if _late(result.curves) else "",
        ranks="; rewards are ranked by the score when played instead" if played is not None else "",
    )
    parts = _parts(result.curves) if played is not None else []
    return "\n".join(
        [*_ending(result), introduction, *summary(result.curves, points=10), *parts, *_costs(played, limits)]
    )


def refusal(sample: Sample) -> str:
    """Why the program never trained."""
    if sample.verdict.code is VerdictCode.SCREENED:
        return f"The reward function was not trained: {sample.verdict.findings[0].message}."
    reasons = [f"- {finding.sentence()}" for finding in sample.verdict.findings]
    return "\n".join(["The reward function could not be used:", *(reasons or [f"- {sample.verdict.code}"])])


def faults(entry: Scored) -> list[str]:
    """Why its program was refused, or its training ended early: a sentence each."""
    if entry.result is None:
        return [finding.sentence() for finding in entry.sample.verdict.findings]
    return _ending(entry.result)


def summary(curves: Curves, *, points: int, brief: bool = False) -> list[str]:
    """A line for each component, then the task score and the episode length. Undefined epochs read `none`."""
    shown = [(_component(name), curve) for name, curve in of_components(curves).items()]
    shown += [(name, curves.get(key, ())) for name, key in _MEASURED.items()]
    interval = _interval(curves, points)
    return [_line(name, curve, interval, brief) for name, curve in shown]


def _component(name: str) -> str:
    """The name of a component in the feedback, told apart from the names of measured curves."""
    return f"component {name}" if name in _MEASURED else name


def _parts(curves: Curves) -> list[str]:
    """A line on when in an episode components pay; nothing for trainings that did not record it."""

    def at(part: str, name: str) -> str:
        return _number(next(iter(curves.get(f"component_{part}/{name}", ())), None), brief=False)

    names = [name.removeprefix("component_early/") for name in curves if name.startswith("component_early/")]
    means = ", ".join(f"{_component(name)} {at('early', name)} then {at('late', name)}" for name in names)
    return [f"{_EARLY_AND_LATE}: {means}"] if means else []


def _costs(played: Evaluation | None, limits: Limits) -> list[str]:
    """A line on the costs that have a limit."""
    if played is None or not limits:
        return []
    told = ", ".join(
        f"{name} {_number(played.costs.get(name), brief=False)} of at most {most:g}" for name, most in limits.items()
    )
    end = " It breaks a limit, so it cannot win: mind what it breaks first." if played.broken(limits) else ""
    return [f"Costs of its policy when played: {told}.{end}"]


def _ending(result: TrainingResult) -> list[str]:
    """A sentence for a training that did not finish."""
    if result.state is TrainingState.FINISHED:
        return []
    if result.state is TrainingState.FAILED:
        return ["No policy could be trained with this reward function."]  # the cause is for people, not for the model
    if result.state is TrainingState.CUT:
        return [f"The training was cut {result.message} rewards; others went on."]
    reason = f" ({result.message})" if result.message else ""
    return [f"The training was stopped early{reason}."]


def _staged(result: TrainingResult) -> str:
    """Which part of a curriculum the curves are of; a lane may have been lost before the last stage."""
    if not result.steps_before:
        return ""
    stage = "the last stage" if result.state is TrainingState.FINISHED else "a stage"
    return f", {stage} of a curriculum; it began with what the stages before had taught it"


def _interval(curves: Curves, points: int) -> int:
    """Epochs from one shown point to the next, as published: the length of the training over `points`."""
    return max(_epochs(curves) // points, 1)


def _epochs(curves: Curves) -> int:
    return max(map(len, curves.values()), default=0)


def _late(curves: Curves) -> bool:
    """Whether F was first defined in a later epoch than the first."""
    fitness = curves.get("fitness", ())
    return fitness[:1] == (None,) and any(value is not None for value in fitness)


def _line(name: str, curve: Sequence[float | None], interval: int, brief: bool) -> str:
    """`name: [first, ..., last], Max: , Mean: , Min: ` with the extremes over all epochs, not only those shown."""
    series = ", ".join(_number(value, brief) for value in curve[::interval])
    known = defined(curve)
    if not known:
        return f"{name}: [{series}]"
    high, low = _number(max(known), brief), _number(min(known), brief)
    return f"{name}: [{series}], Max: {high}, Mean: {_number(mean(known), brief)}, Min: {low}"


def _number(value: float | None, brief: bool) -> str:
    """Two decimals (one when brief), but two significant digits for numbers that this would round away."""
    if value is None or not math.isfinite(value):
        return "none"
    if 0 < abs(value) < 0.1:
        return f"{value:.2g}"
    return f"{value:.1f}" if brief else f"{value:.2f}"
