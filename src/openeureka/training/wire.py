"""Jobs, progress and results as worker frames: JSON headers, policies as blobs."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence

from ..reward import graph
from ..types import Checkpoint, TrainBudget, TrainingProgress, TrainingResult, TrainingState, TrainJob
from ..worker import Frame

PEAKS = ("best_fitness", "best_reward")
SNAPSHOT = "snapshot"
"""The blob that holds the state of a training under way."""


def pack_jobs(env: str, jobs: Sequence[TrainJob], budget: TrainBudget) -> Frame:
    """What to train; policies to go on from are blobs."""
    packed = [
        {
            "id": job.id,
            "seed": job.seed,
            "program": job.program if isinstance(job.program, str) else {"graph": graph.to_json(job.program)},
            # Snapshots are known by this header: trainings that begin elsewhere must not share one.
            "start": hashlib.sha256(job.start).hexdigest() if job.start is not None else None,
        }
        for job in jobs
    ]
    starts = {job.id: job.start for job in jobs if job.start is not None}
    return Frame({"env": env, "jobs": packed, "budget": dataclasses.asdict(budget)}, starts)


def unpack_jobs(frame: Frame) -> tuple[str, list[TrainJob], TrainBudget]:
    """Inverse of `pack_jobs`; graphs are validated again."""
    header = frame.header
    jobs = [
        TrainJob(
            id=job["id"],
            seed=job["seed"],
            program=job["program"] if isinstance(job["program"], str) else graph.from_json(job["program"]["graph"]),
            start=frame.blobs.get(job["id"]),
        )
        for job in header["jobs"]
    ]
    return header["env"], jobs, TrainBudget(**header["budget"])


def pack(message: TrainingProgress | TrainingResult) -> Frame:
    if isinstance(message, TrainingProgress):
        return Frame({"progress": dataclasses.asdict(message)})
    names = (field.name for field in dataclasses.fields(message))
    fields = {name: getattr(message, name) for name in names if name not in (*PEAKS, "last")}
    peaks = {name: peak for name in PEAKS if (peak := getattr(message, name)) is not None}
    fields["peaks"] = {name: {"epoch": peak.epoch, "value": peak.value} for name, peak in peaks.items()}
    last = {"last": message.last} if message.last is not None else {}
    return Frame({"result": fields}, {name: peak.policy for name, peak in peaks.items()} | last)


def unpack(frame: Frame) -> TrainingProgress | TrainingResult:
    """Inverse of `pack`."""
    if "progress" in frame.header:
        return TrainingProgress(**frame.header["progress"])
    fields = dict(frame.header["result"])
    peaks = {name: Checkpoint(policy=frame.blobs[name], **peak) for name, peak in fields.pop("peaks").items()}
    fields["state"] = TrainingState(fields["state"])
    fields["curves"] = {name: tuple(curve) for name, curve in fields["curves"].items()}
    fields["clock"] = tuple(fields["clock"])
    return TrainingResult(
        **fields,
        best_fitness=peaks.get("best_fitness"),
        best_reward=peaks.get("best_reward"),
        last=frame.blobs.get("last"),
    )
