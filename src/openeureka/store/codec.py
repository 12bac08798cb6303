"""The nouns of a run as JSON text and back. Nothing here trusts a length, a surrogate or a float to be sane."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from typing import Any

from ..types import (
    Arg,
    Checkpoint,
    Evaluation,
    Finding,
    Node,
    RewardGraph,
    TrainingResult,
    TrainingState,
    Verdict,
    VerdictCode,
)

MAX_TEXT = 1 << 20
"""Characters kept of a text that a model or a program wrote."""


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
    data = json.loads(text)
    return Verdict(
        candidate=data["candidate"],
        code=VerdictCode(data["code"]),
        findings=tuple(Finding(**finding) for finding in data["findings"]),
        graph=_graph(data["graph"]) if data["graph"] is not None else None,
        seconds=data["seconds"],
    )


def _graph(data: Any) -> RewardGraph:
    nodes = [
        Node(
            node["op"],
            tuple(_arg(arg) for arg in node["args"]),
            {name: _arg(arg) for name, arg in node["kwargs"].items()},
        )
        for node in data["nodes"]
    ]
    components = tuple((name, index) for name, index in data["components"])
    return RewardGraph(nodes=tuple(nodes), reward=data["reward"], components=components)


def _arg(value: Any) -> Arg:
    """JSON has lists where graphs have tuples."""
    if isinstance(value, list):
        return tuple(_arg(item) for item in value)
    if isinstance(value, dict):
        return {name: _arg(item) for name, item in value.items()}
    return value


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
            "correlation": finite(result.correlation),
            "best_fitness": _peak(result.best_fitness),
            "best_reward": _peak(result.best_reward),
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


def decode_digest(text: str, peak: str) -> str | None:
    """The digest of one of a result's policies; None where it has none, empty where an older version kept none."""
    data = json.loads(text)[f"best_{peak}"]
    return data.get("sha256", "") if data is not None else None


def decode_result(job: str, text: str) -> TrainingResult:
    """The result with empty policies: those are read one at a time, when they are needed."""
    data = json.loads(text)
    peaks = {
        name: Checkpoint(epoch=data[name]["epoch"], value=data[name]["value"], policy=b"") if data[name] else None
        for name in ("best_fitness", "best_reward")
    }
    return TrainingResult(
        job=job,
        state=TrainingState(data["state"]),
        fitness=data["fitness"],
        curves={name: tuple(curve) for name, curve in data["curves"].items()},
        env_steps=data["env_steps"],
        seconds=data["seconds"],
        correlation=data["correlation"],
        message=data["message"],
        **peaks,
    )


def encode_evaluation(evaluation: Evaluation) -> dict[str, Any]:
    """A row: its fields, undefined numbers as None."""
    row = dataclasses.asdict(evaluation)
    return row | {name: finite(row[name]) for name in ("fitness", "error", "concentration")}
