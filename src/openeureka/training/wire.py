"""Jobs, progress and results as worker frames: JSON headers, policies as blobs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from ..reward import graph
from ..types import Checkpoint, TrainBudget, TrainingProgress, TrainingResult, TrainingState, TrainJob
from ..worker import Frame

PEAKS = ("best_fitness", "best_reward")
SNAPSHOT = "snapshot"
"""The blob that holds the state of a training under way."""


def pack_jobs(env: str, jobs: Sequence[TrainJob], budget: TrainBudget) -> dict[str, Any]:
    """What to train."""
    packed = [
        {
            "id": job.id,
            "seed": job.seed,
            "program": job.program if isinstance(job.program, str) else {"graph": graph.to_json(job.program)},
        }
        for job in jobs
    ]
    return {"env": env, "jobs": packed, "budget": dataclasses.asdict(budget)}


def unpack_jobs(header: Mapping[str, Any]) -> tuple[str, list[TrainJob], TrainBudget]:
    """Inverse of `pack_jobs`; graphs are validated again."""
    jobs = [
        TrainJob(
            id=job["id"],
            seed=job["seed"],
            program=job["program"] if isinstance(job["program"], str) else graph.from_json(job["program"]["graph"]),
        )
        for job in header["jobs"]
    ]
    return header["env"], jobs, TrainBudget(**header["budget"])


def pack(message: TrainingProgress | TrainingResult) -> Frame:
    if isinstance(message, TrainingProgress):
        return Frame({"progress": dataclasses.asdict(message)})
    fields = {f.name: getattr(message, f.name) for f in dataclasses.fields(message) if f.name not in PEAKS}
    peaks = {name: peak for name in PEAKS if (peak := getattr(message, name)) is not None}
    fields["peaks"] = {name: {"epoch": peak.epoch, "value": peak.value} for name, peak in peaks.items()}
    return Frame({"result": fields}, {name: peak.policy for name, peak in peaks.items()})


def unpack(frame: Frame) -> TrainingProgress | TrainingResult:
    """Inverse of `pack`."""
    if "progress" in frame.header:
        return TrainingProgress(**frame.header["progress"])
    fields = dict(frame.header["result"])
    peaks = {name: Checkpoint(policy=frame.blobs[name], **peak) for name, peak in fields.pop("peaks").items()}
    fields["state"] = TrainingState(fields["state"])
    fields["curves"] = {name: tuple(curve) for name, curve in fields["curves"].items()}
    return TrainingResult(**fields, best_fitness=peaks.get("best_fitness"), best_reward=peaks.get("best_reward"))
