"""Lanes, progress and results as worker frames: nouns in headers, policies as blobs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

from ..codec import defined, plain, shaped
from ..reward.validate import validate
from ..types import LaneSpec, RewardGraph, TrainBudget, TrainingProgress, TrainingResult
from ..worker import Frame

SNAPSHOT = "snapshot"
"""The blob that holds the state of a training under way."""
PAUSED = "paused"
"""The blob that holds the state of a lane."""


def pack_lanes(env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Frame:
    """What to train; policies and states to go on from are blobs."""
    starts = {lane.id: lane.start for lane in lanes if lane.start is not None}
    starts |= {f"{lane.id} {PAUSED}": lane.paused for lane in lanes if lane.paused is not None}
    header = {
        "env": env,
        "lanes": [replace(lane, start=None, paused=None) for lane in lanes],
        "budget": budget,
        # Snapshots are known by this header: trainings that begin elsewhere must not share one.
        "starts": {name: hashlib.sha256(start).hexdigest() for name, start in starts.items()},
    }
    return Frame(plain(header), starts)


def unpack_lanes(frame: Frame) -> tuple[str, list[LaneSpec], TrainBudget]:
    """Inverse of `pack_lanes`; graphs are validated again."""
    lanes = shaped(list[LaneSpec], frame.header["lanes"])
    for lane in lanes:
        if isinstance(lane.program, RewardGraph):
            validate(lane.program)
    blobs = frame.blobs
    started = [replace(lane, start=blobs.get(lane.id), paused=blobs.get(f"{lane.id} {PAUSED}")) for lane in lanes]
    return frame.header["env"], started, shaped(TrainBudget, frame.header["budget"])


def pack(message: TrainingProgress | TrainingResult) -> Frame:
    if isinstance(message, TrainingProgress):
        return Frame({"progress": defined(message)})
    paused = {PAUSED: message.paused} if message.paused is not None else {}
    return Frame({"result": defined(message.holding({}))}, message.policies | paused)


def unpack(frame: Frame) -> TrainingProgress | TrainingResult:
    """Inverse of `pack`."""
    if "progress" in frame.header:
        return shaped(TrainingProgress, frame.header["progress"])
    return replace(shaped(TrainingResult, frame.header["result"]).holding(frame.blobs), paused=frame.blobs.get(PAUSED))
