"""The nouns of a run as JSON text and back. Nothing here trusts a length, a surrogate or a float to be sane."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping
from typing import Any, cast, get_args

from ..types import (
    Arg,
    Checkpoint,
    Evaluation,
    Finding,
    Lane,
    Message,
    Node,
    Peak,
    Place,
    Remark,
    RemarkKind,
    RewardGraph,
    Role,
    TrainingResult,
    TrainingState,
    Verdict,
    VerdictCode,
)

MAX_TEXT = 1 << 20
"""Characters kept of a text that a model or a program wrote."""


EVERY_EPOCH = ("fitness", "episode_length", "reward", "human_reward")
"""Curves that have a value, or None, for each epoch."""
DAMAGE = (ValueError, KeyError, TypeError, AttributeError, RecursionError)
"""What decoding raises for a row that somebody or something has changed."""
_NUMBER = float | int | None


def _typed(kind: Any, value: Any) -> Any:
    if not isinstance(value, kind):
        raise TypeError(f"{value!r:.40} is no {kind}")
    return value


def _number(value: Any) -> Any:
    """A number that is one, or None; JSON knows infinities and digits without end."""
    if isinstance(_typed(_NUMBER, value), bool) or (isinstance(value, float) and not math.isfinite(value)):
        raise ValueError(f"{value!r:.40} is no finite number")
    return value


def _seconds(value: Any) -> float:
    return _count(value) if isinstance(value, int) else _typed(float, _number(value))


def _count(value: Any) -> int:
    if not 0 <= _typed(int, _number(value)) < 2**53:
        raise ValueError(f"{value!r:.40} is no count")
    return value


def _label(value: Any) -> str:
    """A name that every file format can hold."""
    _typed(str, value).encode()
    return value


def safe_text(text: str) -> str:
    """Text that UTF-8 and SQLite can hold: capped, without lone surrogates and NUL."""
    return text[:MAX_TEXT].encode("utf-8", "replace").decode().replace("\0", "\N{REPLACEMENT CHARACTER}")


def finite(value: float | None) -> float | None:
    """None for NaN and infinities: an undefined number stays undefined, and never becomes 0."""
    return value if value is not None and math.isfinite(value) else None


# --- verdicts --------------------------------------------------------------------------------------------------------


def encode_verdict(verdict: Verdict, *, indent: int | None = None) -> str:
    return json.dumps(dataclasses.asdict(verdict), indent=indent)


def decode_verdict(text: str) -> Verdict:
    """Raises one of `DAMAGE` for anything but a verdict. Whether its graph may train is for the trainer to judge."""
    data = json.loads(text)
    verdict = Verdict(
        candidate=_identity(data["candidate"]),
        code=VerdictCode(data["code"]),
        findings=tuple(_finding(**finding) for finding in data["findings"]),
        graph=_graph(data["graph"]) if data["graph"] is not None else None,
        seconds=_seconds(data["seconds"]),
    )
    if verdict.accepted != (verdict.graph is not None):
        raise ValueError("an accepted verdict has a graph, and no other")
    return verdict


def _identity(value: Any) -> str:
    """Of a candidate, which names files; empty for a reply without a program."""
    if value and not (_typed(str, value).isascii() and value.replace("_", "").isalnum()):
        raise ValueError(f"{value!r:.40} is no candidate")
    return value


def _finding(rule: object, message: object, fix: object, line: object) -> Finding:
    return Finding(
        rule=_typed(str, rule),
        message=_typed(str, message),
        fix=_typed(str, fix),
        line=_count(line) if line is not None else None,
    )


def _graph(data: Any) -> RewardGraph:
    nodes = [
        Node(
            _typed(str, node["op"]),
            tuple(_arg(arg) for arg in node["args"]),
            {name: _arg(arg) for name, arg in node["kwargs"].items()},
        )
        for node in data["nodes"]
    ]
    components = tuple((_typed(str, name), _typed(int, index)) for name, index in data["components"])
    return RewardGraph(nodes=tuple(nodes), reward=_typed(int, data["reward"]), components=components)


def _arg(value: Any) -> Arg:
    """JSON has lists where graphs have tuples."""
    if isinstance(value, list):
        return tuple(_arg(item) for item in value)
    if isinstance(value, dict):
        return {name: _arg(item) for name, item in value.items()}
    return value


# --- prompts ---------------------------------------------------------------------------------------------------------


def decode_messages(text: str) -> tuple[Message, ...]:
    """Raises one of `DAMAGE` for anything but a conversation."""
    return tuple(_message(**message) for message in _typed(list, json.loads(text)))


def _message(role: Any, content: Any) -> Message:
    if role not in ("system", "user", "assistant"):
        raise ValueError(f"{role!r:.40} takes no part in a conversation")
    return Message(role, safe_text(_typed(str, content)))


# --- lanes -----------------------------------------------------------------------------------------------------------


def decode_lane(job: str, reward: str, seed: int, role: str) -> Lane:
    """Raises one of `DAMAGE` for a lane that contradicts its name."""
    lane = Lane(_label(reward), _count(seed), cast(Role, role))
    if role not in get_args(Role) or lane.id != job:
        raise ValueError(f"{job!r:.40} is no lane")
    return lane


# --- training results ------------------------------------------------------------------------------------------------


def encode_result(result: TrainingResult) -> str:
    """Everything but the policies, which are files of their own."""
    return json.dumps(
        {
            "state": result.state,
            "fitness": finite(result.fitness),
            "curves": {name: [finite(value) for value in curve] for name, curve in result.curves.items()},
            "env_steps": result.env_steps,
            "seconds": result.seconds,
            "clock": list(result.clock),
            "correlation": finite(result.correlation),
            "best_fitness": _peak(result.best_fitness),
            "best_reward": _peak(result.best_reward),
            "last": {"sha256": digest(result.last)} if result.last is not None else None,
            "message": safe_text(result.message),
        },
        allow_nan=False,
    )


def _peak(checkpoint: Checkpoint | None) -> dict[str, Any] | None:
    if checkpoint is None:
        return None
    return {"epoch": checkpoint.epoch, "value": finite(checkpoint.value), "sha256": digest(checkpoint.policy)}


def digest(policy: bytes) -> str:
    """What tells whether the policy's file is still the one that was written."""
    return hashlib.sha256(policy).hexdigest()


def decode_digest(text: str, peak: Peak) -> str | None:
    """The digest of one of a result's policies; None where it has none, empty where an older version kept none."""
    data = json.loads(text).get(policy_name(peak))
    return data.get("sha256", "") if data is not None else None


def policy_name(peak: Peak) -> str:
    """Of one of a lane's policies, in its result and as a file."""
    return "last" if peak == "last" else f"best_{peak}"


def decode_result(job: str, text: str) -> TrainingResult:
    """The result with empty policies: those are read one at a time, when they are needed.

    Raises one of `DAMAGE` for anything but a result.
    """
    data = json.loads(text)
    return _sound(
        TrainingResult(
            job=job,
            state=TrainingState(data["state"]),
            fitness=_number(data["fitness"]),
            curves={_label(name): tuple(map(_number, curve)) for name, curve in data["curves"].items()},
            env_steps=_count(data["env_steps"]),
            clock=tuple(map(_seconds, data.get("clock", ()))),
            seconds=_seconds(data["seconds"]),
            correlation=_number(data["correlation"]),
            message=_typed(str, data["message"]),
            best_fitness=_checkpoint(data["best_fitness"]),
            best_reward=_checkpoint(data["best_reward"]),
        )
    )


def _sound(result: TrainingResult) -> TrainingResult:
    """Raises ValueError where its epochs contradict each other: who reads a curve at a peak's epoch relies on them."""
    lengths = {len(result.curves[name]) for name in EVERY_EPOCH if name in result.curves}
    peaks = [peak.epoch for peak in (result.best_fitness, result.best_reward) if peak is not None]
    if len(lengths) > 1 or any(epoch >= length for epoch in peaks for length in lengths):
        raise ValueError("a training has as many epochs in all of its curves, and its peaks among them")
    return result


def _checkpoint(data: Any) -> Checkpoint | None:
    if data is None:
        return None
    return Checkpoint(epoch=_count(data["epoch"]), value=_number(data["value"]), policy=b"")


# --- remarks ---------------------------------------------------------------------------------------------------------


def encode_remark(remark: Remark) -> dict[str, str | int | None]:
    """The columns of a row."""
    generation, slot = remark.candidate or (None, None)
    over_generation, over_slot = remark.over or (None, None)
    return {
        "kind": remark.kind,
        "text": safe_text(remark.text),
        "generation": generation,
        "slot": slot,
        "over_generation": over_generation,
        "over_slot": over_slot,
    }


def decode_remark(row: Mapping[str, Any]) -> Remark:
    return Remark(
        kind=RemarkKind(row["kind"]),
        text=row["text"],
        candidate=_place(row["generation"], row["slot"]),
        over=_place(row["over_generation"], row["over_slot"]),
    )


def _place(generation: int | None, slot: int | None) -> Place | None:
    return Place(generation, slot) if generation is not None and slot is not None else None


def encode_evaluation(evaluation: Evaluation) -> dict[str, Any]:
    """A row: its fields, undefined numbers as None."""
    row = dataclasses.asdict(evaluation)
    return row | {name: finite(row[name]) for name in ("fitness", "error", "concentration")}
