"""Jobs, progress and results as worker frames: nouns in headers, policies as blobs."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

from ..codec import defined, plain, shaped
from ..reward.validate import validate
from ..types import RewardGraph, TrainBudget, TrainingProgress, TrainingResult, TrainJob
from ..worker import Frame

SNAPSHOT = "snapshot"
"""The blob that holds the state of a training under way."""


def pack_jobs(env: str, jobs: Sequence[TrainJob], budget: TrainBudget) -> Frame:
    """What to train; policies to go on from are blobs."""
    starts = {job.id: job.start for job in jobs if job.start is not None}
    header = {
        "env": env,
        "jobs": [replace(job, start=None) for job in jobs],
        "budget": budget,
        # Snapshots are known by this header: trainings that begin elsewhere must not share one.
        "starts": {name: hashlib.sha256(start).hexdigest() for name, start in starts.items()},
    }
    return Frame(plain(header), starts)


def unpack_jobs(frame: Frame) -> tuple[str, list[TrainJob], TrainBudget]:
    """Inverse of `pack_jobs`; graphs are validated again."""
    jobs = shaped(list[TrainJob], frame.header["jobs"])
    for job in jobs:
        if isinstance(job.program, RewardGraph):
            validate(job.program)
    started = [replace(job, start=frame.blobs.get(job.id)) for job in jobs]
    return frame.header["env"], started, shaped(TrainBudget, frame.header["budget"])


def pack(message: TrainingProgress | TrainingResult) -> Frame:
    if isinstance(message, TrainingProgress):
        return Frame({"progress": plain(message)})
    return Frame({"result": defined(message.holding({}))}, message.policies)


def unpack(frame: Frame) -> TrainingProgress | TrainingResult:
    """Inverse of `pack`."""
    if "progress" in frame.header:
        return shaped(TrainingProgress, frame.header["progress"])
    return shaped(TrainingResult, frame.header["result"]).holding(frame.blobs)
