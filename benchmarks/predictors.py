"""What tells early how a training will end? Curves of finished searches, cut off at a share of their epochs.

    python benchmarks/predictors.py outputs/ant outputs/quad     # adds the lanes of these runs to the results
    make docs                                                    # the table in docs/concepts/schedule.md

A lane is worth what its policy scores when it is played at the end. A signal is a number that its curves held after
1/16, 1/8, 1/4 or 1/2 of the training; it is good if it ranks lanes as their worth does, and if the best lane is near
its top. Lanes of all runs of a task, of candidates alone, stand together; equal steps are a must.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from scipy.stats import spearmanr

import openeureka
from openeureka.report.text import number
from openeureka.score import mean

RESULTS = Path(__file__).parent / "results" / "predictors.json"
SHARES = (1 / 16, 1 / 8, 1 / 4, 1 / 2)
Curves = Mapping[str, Sequence[float | None]]
Record = dict[str, Any]


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
    """F at the end, if it goes on as in the newer half."""
    now, before = window(curves["fitness"], end), window(curves["fitness"], end // 2)
    if now is None or before is None:
        return None
    return now + (now - before) / (end - end // 2) * (total - end)


def together(curves: Curves, end: int, _: int) -> float | None:
    """Rank correlation of F and own reward over the epochs so far."""
    pairs = [(a, b) for a, b in zip(curves["fitness"][:end], curves["reward"][:end], strict=True) if None not in (a, b)]
    return _correlation(pairs)


def certainty(curves: Curves, end: int, _: int) -> float | None:
    """How far the policy's entropy has fallen [nats]."""
    now = window(curves["ppo/entropy"], end)
    first = curves["ppo/entropy"][0] if curves["ppo/entropy"] else None
    return None if now is None or first is None else first - now


def length(curves: Curves, end: int, _: int) -> float | None:
    """Steps of the episodes that ended last."""
    return window(curves["episode_length"], end)


SIGNALS: Mapping[str, Callable[[Curves, int, int], float | None]] = {
    "F in the window": fitness,
    "best F so far": best,
    "F, extrapolated": extrapolated,
    "F and own reward together": together,
    "entropy lost": certainty,
    "episode length": length,
}


def rounded(value: float | None) -> float | None:
    """To five digits."""
    return None if value is None else float(f"{value:.5g}")


def _correlation(pairs: Sequence[tuple[float | None, float | None]]) -> float | None:
    """Spearman's; None where one side is constant."""
    if len(pairs) < 3:
        return None
    a, b = zip(*pairs, strict=True)
    if len(set(a)) == 1 or len(set(b)) == 1:
        return None
    found = float(spearmanr(a, b).statistic)
    return found if math.isfinite(found) else None


def lanes(run: openeureka.Run) -> Record:
    """Of each candidate's lane in the search: its worth, and every signal at every share."""
    found: Record = {}
    for candidate in run.candidates:
        result, score = candidate.result, candidate.played
        if result is None or score is None or score.fitness is None or result.message:
            continue
        total = len(result.curves["fitness"])
        ends = [max(1, round(share * total)) for share in SHARES]
        found[result.lane] = {
            "model": run.config.model,
            "played": score.fitness,
            "error": score.error,
            "signals": {
                title: [rounded(signal(result.curves, end, total)) for end in ends] for title, signal in SIGNALS.items()
            },
        }
    return found


def table(study: Mapping[str, Record]) -> list[tuple[str, ...]]:
    """Of each signal and share: its rank correlation with worth, and the place of the best lane by it, task by task."""
    rows: list[tuple[str, ...]] = []
    for title in SIGNALS:
        for place, share in enumerate(SHARES):
            cells = [_cell(task["lanes"], title, place) for task in study.values()]
            known = [correlation for correlation, _ in cells if correlation is not None]
            shown = [f"{number(c, 2)}, {rank}" if c is not None else f"-, {rank}" for c, rank in cells]
            rows.append((title, f"1/{round(1 / share)}", *shown, number(mean(known), 2)))
    return rows


def _cell(found: Mapping[str, Record], title: str, place: int) -> tuple[float | None, str]:
    """The correlation, and the place that the signal gives to the lane of the highest worth (ties count against it)."""
    pairs = [(lane["signals"][title][place], lane["played"]) for lane in found.values()]
    ranked = [(-math.inf if signal is None else signal, worth) for signal, worth in pairs]
    top = max(ranked, key=lambda pair: pair[1])
    rank = sum(signal >= top[0] for signal, _ in ranked)
    return _correlation(ranked), f"{rank} of {len(ranked)}"


def titles(study: Mapping[str, Record]) -> tuple[str, ...]:
    return ("signal", "after", *study, "mean")


def known() -> dict[str, Record]:
    """What is measured so far, by task."""
    return json.loads(RESULTS.read_text()) if RESULTS.exists() else {}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("directories", type=Path, nargs="*")
    study = known()
    for directory in parser.parse_args().directories:
        run = openeureka.open_run(directory)
        task = study.setdefault(run.config.env, {"steps": run.config.steps, "lanes": {}})
        if task["steps"] != run.config.steps:
            raise SystemExit(f"{directory} trained {run.config.steps} steps, the others {task['steps']}.")
        task["lanes"] |= lanes(run)
        task["date"] = datetime.now(UTC).date().isoformat()
    RESULTS.write_text(json.dumps(study, sort_keys=True) + "\n")
    for row in [titles(study), *table(study)]:
        print(" | ".join(row))


if __name__ == "__main__":
    main()
