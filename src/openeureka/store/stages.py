"""Finished stages of lanes: a result and a policy beside the lane's other files."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from ..types import TrainingResult
from . import artifacts
from .codec import decode_result, encode_result
from .db import explained


class StageFiles:
    """Remembers stages as `<folder>/<job>/stage<number>.json` and, of a lane that goes on, its last policy beside it.

    The policy comes first: a stage whose JSON is there is whole.

    Args:
        resumes: whether stages that are there already belong to this training, and need not be repeated.
    """

    def __init__(self, folder: Path, *, resumes: bool) -> None:
        self._folder, self._resumes = folder, resumes

    def save(self, stage: int, result: TrainingResult) -> None:
        if result.last is not None:
            artifacts.write(self._path(stage, result.job, "safetensors"), result.last)
        artifacts.write(self._path(stage, result.job, "json"), encode_result(result))

    def read(self, stage: int, job: str) -> TrainingResult | None:
        """The result with its last policy, the others empty; None when the stage was not finished."""
        path, policy = (self._path(stage, job, suffix) for suffix in ("json", "safetensors"))
        with explained(self._folder):
            if not (self._resumes and path.is_file()):
                return None
            last = policy.read_bytes() if policy.is_file() else None
            return dataclasses.replace(decode_result(job, path.read_text()), last=last)

    def _path(self, stage: int, job: str, suffix: str) -> Path:
        return self._folder / job / f"stage{stage}.{suffix}"
