"""Lanes, progress, results and scores as worker frames: nouns in headers, policies and states as blobs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..codec import convert, to_builtins, to_finite
from ..reward.validate import validate
from ..types import (
    Episodes,
    Evaluation,
    LaneSpec,
    RewardGraph,
    TrainBudget,
    TrainingEvent,
    TrainingProgress,
    TrainingResult,
)
from ..worker import Frame

SNAPSHOT = "snapshot"
"""The blob that holds the state of a training under way."""
PAUSED = "paused"
"""The blob that holds the state of a lane."""
STATES = "states"
"""The blob that holds the states of recorded episodes."""


def pack_lanes(env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Frame:
    """What to train; policies and states to continue from are blobs."""
    starts = {lane.id: lane.start for lane in lanes if lane.start is not None}
    starts |= {f"{lane.id} {PAUSED}": lane.paused for lane in lanes if lane.paused is not None}
    header = {
        "env": env,
        "lanes": [replace(lane, start=None, paused=None) for lane in lanes],
        "budget": budget,
        # Snapshots are identified by this header: trainings with other starts must not share one.
        "starts": {name: hashlib.sha256(start).hexdigest() for name, start in starts.items()},
    }
    return Frame(to_builtins(header), starts)


def unpack_lanes(frame: Frame) -> tuple[str, list[LaneSpec], TrainBudget]:
    """Inverse of `pack_lanes`; graphs are validated again. Lanes with a snapshot need no state of their own."""
    lanes = convert(list[LaneSpec], frame.header["lanes"])
    for lane in lanes:
        if isinstance(lane.program, RewardGraph):
            validate(lane.program)
    blobs = frame.blobs
    paused = {} if SNAPSHOT in blobs else {lane.id: blobs.get(f"{lane.id} {PAUSED}") for lane in lanes}
    started = [replace(lane, start=blobs.get(lane.id), paused=paused.get(lane.id)) for lane in lanes]
    return frame.header["env"], started, convert(TrainBudget, frame.header["budget"])


def pack(message: TrainingEvent) -> Frame:
    if isinstance(message, TrainingProgress):
        return Frame({"progress": to_finite(message)})
    return Frame({"result": to_finite(message.holding({}))}, message.blobs)


def unpack(frame: Frame) -> TrainingEvent:
    """Inverse of `pack`."""
    if "progress" in frame.header:
        return convert(TrainingProgress, frame.header["progress"])
    return convert(TrainingResult, frame.header["result"]).holding(frame.blobs)


def pack_score(score: Evaluation) -> Frame:
    if score.recorded is None:
        return Frame({"score": to_finite(score)})
    bare = replace(score, recorded=replace(score.recorded, states=b""))
    return Frame({"score": to_finite(bare)}, {STATES: score.recorded.states})


def unpack_score(frame: Frame) -> Evaluation:
    """Inverse of `pack_score`."""
    score = convert(Evaluation, frame.header["score"])
    if score.recorded is None:
        return score
    return replace(score, recorded=replace(score.recorded, states=frame.blobs[STATES]))


def pack_question(env: str, programs: Mapping[str, RewardGraph], episodes: Sequence[Episodes]) -> Frame:
    """The question what programs would have paid in recorded episodes."""
    bare = [replace(one, states=b"") for one in episodes]
    header = {"do": "rewards", "env": env, "programs": programs, "episodes": bare}
    return Frame(to_builtins(header), {str(place): one.states for place, one in enumerate(episodes)})


def unpack_question(frame: Frame) -> tuple[str, dict[str, RewardGraph], list[Episodes]]:
    """Inverse of `pack_question`."""
    bare = convert(list[Episodes], frame.header["episodes"])
    episodes = [replace(one, states=frame.blobs[str(place)]) for place, one in enumerate(bare)]
    return frame.header["env"], convert(dict[str, RewardGraph], frame.header["programs"]), episodes
