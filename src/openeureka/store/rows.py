"""Nouns as rows and back: in columns, with digests in place of policies, and texts made safe to store."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from ..codec import DecodeError, convert, decode, encode, to_finite
from ..text import safe_text
from ..types import Evaluation, Lane, Message, Peak, Place, Remark, Reply, Screened, TrainingResult, Usage, Verdict
from ..types.bounds import Finite, Name

Costs = Mapping[Name, Finite]
EVERY_EPOCH = ("fitness", "episode_length", "reward", "human_reward")
"""Curves that have a value, or None, for each epoch."""


def decode_verdict(text: str) -> Verdict:
    """Raises DecodeError for anything but a verdict. Whether its graph may train is for the trainer to judge."""
    verdict = decode(Verdict, text)
    if verdict.accepted != (verdict.graph is not None):
        raise DecodeError("an accepted verdict has a graph, and no other")
    return verdict


def decode_messages(text: str) -> tuple[Message, ...]:
    """Raises DecodeError for anything but a conversation."""
    return tuple(replace(message, content=safe_text(message.content)) for message in decode(tuple[Message, ...], text))


def encode_messages(messages: Iterable[Message]) -> str:
    return encode([replace(message, content=safe_text(message.content)) for message in messages])


def encode_reply(reply: Reply) -> dict[str, Any]:
    """The columns that every reply has."""
    text = {"text": safe_text(reply.text), "model": safe_text(reply.model), "seconds": reply.seconds}
    return text | asdict(reply.usage)


def decode_reply(row: Mapping[str, Any]) -> Reply:
    return Reply(text=row["text"], model=row["model"], usage=decode_usage(row), seconds=row["seconds"])


def decode_usage(row: Mapping[str, Any]) -> Usage:
    return Usage(
        prompt_tokens=row["prompt_tokens"], completion_tokens=row["completion_tokens"], cost_usd=row["cost_usd"]
    )


# --- lanes -----------------------------------------------------------------------------------------------------------


def encode_lane(lane: Lane) -> dict[str, Any]:
    """The columns of a row."""
    row: dict[str, Any] = {"lane": lane.id, "reward": lane.reward, "seed": lane.seed, "role": lane.role}
    if lane.start is not None:
        policy = lane.start.policy
        row |= {"start_lane": policy.lane, "start_peak": policy.peak, "start_fresh": lane.start.fresh}
    return row | ({"ranges": lane.ranges} if lane.ranges else {})


def decode_lane(row: Mapping[str, Any]) -> Lane:
    """Raises DecodeError for a row whose lane id contradicts its other columns."""
    columns = {name: row[name] for name in ("reward", "seed", "role")}
    if row["start_lane"] is not None:
        columns["start"] = {"policy": (row["start_lane"], row["start_peak"]), "fresh": row["start_fresh"]}
    if row["ranges"] is not None:
        columns["ranges"] = row["ranges"]
    lane = convert(Lane, columns)
    if lane.id != row["lane"]:
        raise DecodeError(f"{row['lane']!r:.40} is no lane")
    return lane


# --- training results ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _File:
    """What a row says of a policy."""

    sha256: str


@dataclass(frozen=True, slots=True)
class _Files:
    """The policies in a row of a result."""

    best_fitness: _File | None = None
    best_reward: _File | None = None
    last: _File | None = None


def encode_result(result: TrainingResult) -> str:
    """Everything but the policies, which are files of their own."""
    data = to_finite(replace(result.holding({}), message=safe_text(result.message)))
    for name, policy in result.policies.items():
        peak: dict[str, Any] = data[name] or {}
        peak.pop("policy", None)
        data[name] = peak | {"sha256": digest(policy)}
    return encode(data)


def digest(policy: bytes) -> str:
    """SHA-256 of a policy. It tells whether the policy's file is still what was written."""
    return hashlib.sha256(policy).hexdigest()


def damaged(policy: bytes | None, wanted: str) -> bool:
    """Whether a policy's file is missing, or not what `decode_digest` says was written."""
    return not policy or digest(policy) != wanted


def decode_digest(text: str | bytes, peak: Peak) -> str | None:
    """The digest of one of a result's policies; None where it has none."""
    file: _File | None = getattr(decode(_Files, text), policy_name(peak))
    return file.sha256 if file is not None else None


def policy_name(peak: Peak) -> str:
    """Name of one of a lane's policies: its field in a `TrainingResult`, and its file without the suffix."""
    return "last" if peak == "last" else f"best_{peak}"


def decode_result(lane: str, text: str | bytes) -> TrainingResult:
    """The result with empty policies: policies are read one at a time, when they are needed.

    Raises:
        DecodeError: for anything but a result. Also where its curves differ in length or a peak's epoch is beyond their
            end, because curves are read at these epochs.
    """
    result = convert(TrainingResult, decode(dict[str, Any], text) | {"lane": lane, "last": None}).holding({})
    lengths = {len(result.curves[name]) for name in EVERY_EPOCH if name in result.curves}
    peaks = [peak.epoch for peak in (result.best_fitness, result.best_reward) if peak is not None]
    if len(lengths) > 1 or any(epoch >= length for epoch in peaks for length in lengths):
        raise DecodeError("a training has as many epochs in all of its curves, and its peaks among them")
    return result


# --- rows ------------------------------------------------------------------------------------------------------------


def encode_place(place: Place | None, prefix: str = "") -> dict[str, Any]:
    """The two columns that name a slot."""
    generation, slot = place or (None, None)
    return {f"{prefix}generation": generation, f"{prefix}slot": slot}


def decode_place(row: Mapping[str, Any], prefix: str = "") -> Place | None:
    """Inverse of `encode_place`."""
    generation, slot = row[f"{prefix}generation"], row[f"{prefix}slot"]
    return Place(generation, slot) if generation is not None and slot is not None else None


def encode_remark(remark: Remark) -> dict[str, Any]:
    """The columns of a row."""
    said = {"kind": remark.kind, "text": safe_text(remark.text)}
    return said | encode_place(remark.place) | encode_place(remark.over, "over_")


def decode_remark(row: Mapping[str, Any]) -> Remark:
    """Raises DecodeError for an unknown kind of remark."""
    places = {"place": decode_place(row), "over": decode_place(row, "over_")}
    return convert(Remark, {"kind": row["kind"], "text": row["text"], **places})


def encode_evaluation(evaluation: Evaluation) -> dict[str, Any]:
    """The columns of a row: undefined numbers are None, recorded episodes are left out (they have a file)."""
    row = to_finite(replace(evaluation, recorded=None))
    del row["recorded"]
    return row | {"costs": encode(evaluation.costs) if evaluation.costs else None}


def decode_evaluation(row: Mapping[str, Any]) -> Evaluation:
    """Inverse of `encode_evaluation`, whatever else the row says of the lane. Raises DecodeError for costs that are not
    numbers by name."""
    columns = {field.name: row[field.name] for field in fields(Evaluation) if field.name != "recorded"}
    columns["noisy"] = bool(row["noisy"])
    columns["costs"] = decode(Costs, row["costs"]) if row["costs"] is not None else {}
    return Evaluation(**columns)


def encode_screened(screened: Screened) -> dict[str, Any]:
    """The columns of a row."""
    row = to_finite(screened) | {"reason": safe_text(screened.reason)}
    del row["place"], row["nearest"]
    return row | encode_place(screened.place) | encode_place(screened.nearest, "nearest_")


def decode_screened(row: Mapping[str, Any]) -> Screened:
    """Inverse of `encode_screened`. Raises DecodeError for anything else."""
    columns = {name: row[name] for name in ("agreement", "error", "likeness", "reason")}
    columns |= {"place": decode_place(row), "nearest": decode_place(row, "nearest_")}
    return convert(Screened, columns | {"kept": bool(row["kept"])})
