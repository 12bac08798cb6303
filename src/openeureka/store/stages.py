"""Finished stages of lanes: a result and a policy beside the lane's other files."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from ..types import TrainingResult
from . import artifacts
from .codec import decode_result, encode_result
from .db import explained


class StageFiles:
    """Remembers stages as `<folder>/<job>/stage<number>.json` and, at the peak of the own reward, `.safetensors`.

    The policy comes first: a stage whose JSON is there is whole.

    Args:
        resumes: whether stages that are there already belong to this training, and need not be repeated.
    """

    def __init__(self, folder: Path, *, resumes: bool) -> None:
        self._folder, self._resumes = folder, resumes

    def save(self, stage: int, result: TrainingResult) -> None:
        if result.best_reward is not None:
            artifacts.write(self._path(stage, result.job, "safetensors"), result.best_reward.policy)
        artifacts.write(self._path(stage, result.job, "json"), encode_result(result))

    def read(self, stage: int, job: str) -> TrainingResult | None:
        """The result with its policy at the peak of the own reward; None when the stage was not finished."""
        path = self._path(stage, job, "json")
        with explained(self._folder):
            if not (self._resumes and path.is_file()):
                return None
            result = decode_result(job, path.read_text())
            if result.best_reward is None:
                return result
            policy = self._path(stage, job, "safetensors").read_bytes()
        return dataclasses.replace(result, best_reward=dataclasses.replace(result.best_reward, policy=policy))

    def _path(self, stage: int, job: str, suffix: str) -> Path:
        return self._folder / job / f"stage{stage}.{suffix}"
