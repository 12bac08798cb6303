"""A run as JSON, for programs: what `--json` prints."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from ..parsing import short_path
from ..refine.hardened import Robust
from ..refine.polishing import Polished
from ..refine.tuned import Tuned
from ..report import robust
from ..report.candidates import CandidateView, GenerationView
from ..report.verdict import verdict
from ..report.view import RunView
from ..runs.run import lanes
from ..score import Outcome
from ..types import Evaluation, Remark, TrainingResult

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


def written(run: RunView, directory: Path | None = None) -> str:
    """The run as JSON text; `directory` comes first where the caller has made it."""
    made = {"directory": str(short_path(directory))} if directory is not None else {}
    return json.dumps({**made, **facts(run)}, indent=2)


def facts(run: RunView) -> dict[str, object]:
    """The run for programs. `fitness` is F in training, its maximum over epochs. Undefined values are null."""
    best, text, outcome = run.best, run.best_text, run.outcome
    return {
        "settings": asdict(run.config),
        "ranked_by": run.ranks,
        "generations": [_generation(generation) for generation in run.generations],
        "unheard": [_remark(remark) for remark in run.unheard],
        "baselines": {name: _scores(run.played.get(r.lane), r) for name, r in run.baselines.items()},
        "given": {
            name: {key: value for key, value in lane.row().items() if key not in ("lane", "role", "place")}
            for name, lane in lanes(run).items()
            if lane.lane.role == "given"
        },
        "tuned": _tuned(run.tuned) if run.tuned is not None else None,
        "polished": _polished(run.polished) if run.polished is not None else None,
        "robust": _robust(run.robust) if run.robust is not None else None,
        "best": {"name": str(best.place), "source": text.source} if best and text else None,
        "final": _final(outcome) if outcome is not None else None,
        "verdict": verdict(run),
        "score": outcome.normalised if outcome is not None else None,
        "suspected": [{"kind": sign.kind, "sentence": sign.sentence} for sign in run.signs],
        "usage": asdict(run.usage),
    }


def _fields(noun: DataclassInstance | None) -> dict[str, object] | None:
    return asdict(noun) if noun is not None else None


def _robust(found: Robust) -> dict[str, object]:
    arms = {
        arm.name: {
            "ranges": arm.ranges.drawn if arm.ranges is not None else {},
            "chosen_by": arm.chosen_by,
            "own_world": _fields(arm.nominal),
            "hard": arm.hard,
            "worlds": {name: _fields(score) for name, score in arm.worlds.items()},
        }
        for arm in found.arms
    }
    return {"ours": found.ours, "arms": arms, "verdict": robust.verdict(found)}


def _polished(found: Polished) -> dict[str, object]:
    return {
        "began": found.began._asdict(),
        "before": _fields(found.before),
        "after": _fields(found.after),
        "gain": _fields(found.gain),
        "best": found.best._asdict() if found.best is not None else None,
        "better": found.better,
        "lanes": [
            {"lane": one.lane.id, "reward": one.lane.reward, "fresh": one.start.fresh} | _scores(one.played, one.result)
            for one in found.tries
        ],
    }


def _tuned(found: Tuned) -> dict[str, object]:
    return {
        "numbers": [
            {
                "name": effect.weight.name,
                "before": effect.weight.value,
                "after": effect.after,
                "trend": _fields(effect.trend),
                "distance": _fields(effect.distance),
                "matters": effect.matters,
            }
            for effect in found.effects
        ],
        "after": found.after,
        "better": found.better,
        "final": {name: _fields(own) for name, own in found.finals.items()},
        "difference": _fields(found.difference),
        "components": {
            name: dict(zip(("before", "after"), pair, strict=True)) for name, pair in found.components.items()
        },
        "trials": [
            {"name": t.name, "candidate": t.candidate.id, "numbers": list(t.values), "played_fitness": t.played}
            for t in found.trials
        ],
    }


def _generation(generation: GenerationView) -> dict[str, object]:
    return {
        "index": generation.index,
        "finished": generation.finished,
        "slots": [_slot_facts(candidate) for candidate in generation.candidates],
        "remarks": [_remark(remark) for remark in generation.remarks],
    }


def _remark(remark: Remark) -> dict[str, str | None]:
    places = {"candidate": remark.place, "over": remark.over}
    named = {name: str(place) if place is not None else None for name, place in places.items()}
    return {"kind": remark.kind, "text": remark.text, **named}


def _slot_facts(slot: CandidateView) -> dict[str, object]:
    return {
        "name": str(slot.place),
        "candidate": slot.program.id if slot.program is not None else None,
        "state": slot.state,
        "verdict": slot.verdict.code if slot.verdict is not None else None,
        "findings": [asdict(finding) for finding in slot.verdict.findings] if slot.verdict else [],
        "attempts": len(slot.attempts),
        **_scores(slot.played, slot.result),
        "votes": slot.strength,
        "vetoed": slot.vetoed,
    }


def _scores(played: Evaluation | None, result: TrainingResult | None) -> dict[str, object]:
    return {
        "played_fitness": played.fitness if played is not None else None,
        "played_error": played.error if played is not None else None,
        "costs": dict(played.costs) if played is not None else {},
        "fitness": result.fitness if result is not None else None,
    }


def _final(outcome: Outcome) -> dict[str, object]:
    """Every reward of the race with a number for each seed, and how much better the best is than the human one."""
    rewards = {"best": outcome.method, **{str(place): own for place, own in outcome.rivals.items()}}
    rewards |= {"human": outcome.human, "sparse": outcome.sparse}
    scores = {name: {"fitness": own.training, "held_out_fitness": own.held_out} for name, own in rewards.items()}
    return {"rewards": scores, "difference": _fields(outcome.difference)}
