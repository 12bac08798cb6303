"""What tells early how a training will end? Curves of finished searches, cut off at a share of their epochs.

    python benchmarks/predictors.py outputs/ant outputs/quad     # adds the lanes of these runs to the results
    make docs                                                    # the tables in docs/reference/measurements.md

A lane is worth what its policy scores when it is played at the end. A signal is a number that its curves held after
1/16, 1/8, 1/4 or 1/2 of the training; it is good if it ranks lanes as their worth does, and if the best lane is near
its top. Lanes of generated rewards of all runs of a task are taken together; they must have equal steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

from intervals import interval
from lanes import joined, rounded
from ledger import in_sentences
from records import Record, command_line, read, results, show, write

import openeureka
from openeureka.numbers import number
from openeureka.score import rank
from openeureka.stats import Estimate, estimate, spearman

RESULTS = results("predictors")
SHARES = (1 / 16, 1 / 8, 1 / 4, 1 / 2)
BASELINES = ("human", "sparse")
Curves = Mapping[str, Sequence[float | None]]


def window(curve: Sequence[float | None], end: int) -> float | None:
    """The newest value before this epoch."""
    return next((value for value in reversed(curve[:end]) if value is not None), None)


def fitness(curves: Curves, end: int, _: int) -> float | None:
    """F of the episodes that ended last."""
    return window(curves["fitness"], end)


def best(curves: Curves, end: int, _: int) -> float | None:
    """The highest F so far."""
    return max((value for value in curves["fitness"][:end] if value is not None), default=None)


def extrapolated(curves: Curves, end: int, total: int) -> float | None:
    """F at the end, if it goes on changing as in the newer half."""
    now, before = window(curves["fitness"], end), window(curves["fitness"], end // 2)
    if now is None or before is None:
        return None
    return now + (now - before) / (end - end // 2) * (total - end)


def together(curves: Curves, end: int, _: int) -> float | None:
    """Rank correlation of F and own reward over the epochs so far."""
    epochs = zip(curves["fitness"][:end], curves["reward"][:end], strict=True)
    known = [(f, own) for f, own in epochs if f is not None and own is not None]
    return spearman([f for f, _ in known], [own for _, own in known])


def certainty(curves: Curves, end: int, _: int) -> float | None:
    """How far the policy's entropy has fallen [nats]."""
    now = window(curves["ppo/entropy"], end)
    first = curves["ppo/entropy"][0] if curves["ppo/entropy"] else None
    return None if now is None or first is None else first - now


def length(curves: Curves, end: int, _: int) -> float | None:
    """Steps of the episodes that ended last."""
    return window(curves["episode_length"], end)


FITNESS = "F in the window"
SIGNALS: Mapping[str, Callable[[Curves, int, int], float | None]] = {
    FITNESS: fitness,
    "best F so far": best,
    "F, extrapolated": extrapolated,
    "F and own reward together": together,
    "entropy lost": certainty,
    "episode length": length,
}
SHOWN = (FITNESS, "entropy lost")
PLACES = range(len(SHARES))
AFTER = tuple(f"after 1/{round(1 / share)}" for share in SHARES)
SIGNAL_TITLES = ("signal", *AFTER)
TASK_TITLES = ("task", "trainings", *AFTER)


def lanes(run: openeureka.Run) -> Record:
    """For each training of a generated reward that was played: its worth, and every signal at every share."""
    found: Record = {}
    for lane, score in run.view.played.items():
        result = run.view.results[lane]
        if run.view.lanes[lane].reward in BASELINES or score.fitness is None or result.message:
            continue
        total = len(result.curves["fitness"])
        ends = [max(1, round(share * total)) for share in SHARES]
        found[lane] = {
            "played": score.fitness,
            "error": score.error,
            "signals": {
                title: [rounded(signal(result.curves, end, total)) for end in ends] for title, signal in SIGNALS.items()
            },
        }
    return found


def signals(study: Mapping[str, Record]) -> list[list[str]]:
    """For each signal and share: its rank correlation with worth, mean over tasks and the 95 % interval of that."""
    return [
        [title, *(_over([spearman(*_columns(task, title, place)) for task in study.values()]) for place in PLACES)]
        for title in SIGNALS
    ]


def summary(study: Mapping[str, Record]) -> str:
    """Whether F tells how a training ends, before it does."""
    found = [[spearman(*_columns(task, FITNESS, place)) for task in study.values()] for place in PLACES]
    sure = [place for place in PLACES if (over := _mean(found[place])) is not None and over.sure]
    place = sure[0] if sure else PLACES[-1]
    return (
        f"{'Something' if sure else 'Nothing certain'}, over {len(study)} tasks. After {Fraction(SHARES[place])} of a "
        f"training, F's rank correlation with the final score is {_over(found[place])}."
    )


def tasks(study: Mapping[str, Record]) -> list[list[str]]:
    """For each task and share: rank correlation of F in the window with worth, and the place of the best lane by it."""
    return [
        [name, str(len(task["lanes"])), *(_cell(*_columns(task, FITNESS, place)) for place in PLACES)]
        for name, task in study.items()
    ]


def correlations(study: Mapping[str, Record]) -> list[tuple[str, str, list[float | None]]]:
    """Task, signal, and the rank correlation at each share, of the signals that the figure shows."""
    return [
        (name, title, [spearman(*_columns(task, title, place)) for place in PLACES])
        for title in SHOWN
        for name, task in study.items()
    ]


def _columns(task: Record, title: str, place: int) -> tuple[list[float], list[float]]:
    """The signal of all lanes, lowest where it is not known yet, and their worth."""
    lanes = task["lanes"].values()
    return [rank(lane["signals"][title][place]) for lane in lanes], [lane["played"] for lane in lanes]


def _mean(found: Sequence[float | None]) -> Estimate | None:
    """Mean over tasks. A signal that is the same for all lanes of a task tells nothing there, and counts as 0."""
    return estimate([value or 0.0 for value in found])


def _over(found: Sequence[float | None]) -> str:
    """Mean and interval."""
    over = _mean(found)
    if over is None or over.low is None or over.high is None:
        return number(over.value if over is not None else None, 2)
    return interval(over.value, over.low, over.high, digits=2)


def _cell(signals: Sequence[float], worths: Sequence[float]) -> str:
    """The correlation, and the place that the signal gives to a lane of the highest worth. Equal signals count against
    it; of lanes of equal worth the one that the signal prefers counts."""
    preferred = max(signal for signal, worth in zip(signals, worths, strict=True) if worth == max(worths))
    place = sum(signal >= preferred for signal in signals)
    return f"{number(spearman(signals, worths), 2)}, {place} of {len(signals)}"


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("directories", type=Path, nargs="*")
    study = read(RESULTS)
    for directory in parser.parse_args().directories:
        with in_sentences():
            run = openeureka.open_run(directory)
        task = study.get(run.config.env, {"steps": run.config.steps})
        if task["steps"] != run.config.steps:
            raise SystemExit(f"{directory} trained {run.config.steps} steps, the others {task['steps']}.")
        study[run.config.env] = joined(task, "lanes", lanes(run), run.config, directory.name)
    write(RESULTS, study)
    show(SIGNAL_TITLES, *signals(study), (), TASK_TITLES, *tasks(study))


if __name__ == "__main__":
    main()
