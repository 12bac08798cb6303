"""Finished stages of a curriculum."""

from __future__ import annotations

from pathlib import Path

from ..codec import DecodeError
from ..types import TrainingResult
from . import artifacts
from .rows import damaged, decode_digest, decode_result, encode_result


class StageFiles:
    """Finished stages of a curriculum: `lanes/<lane>/stage<number>.json` and, where the lane goes on, its last policy.

    The policy is written first, so a stage whose JSON exists is complete. A stage counts as unfinished where its JSON
    cannot be read or its policy is not what was written.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory

    def save(self, stage: int, result: TrainingResult) -> None:
        if result.last is not None:
            artifacts.write(self._directory, _name(stage, result.lane, "safetensors"), result.last)
        artifacts.write(self._directory, _name(stage, result.lane, "json"), encode_result(result))

    def read(self, stage: int, lane: str) -> TrainingResult | None:
        """The stage's result with the last policy; its other policies are empty. None when the stage is unfinished."""
        text = artifacts.read(self._directory, _name(stage, lane, "json"))
        if text is None:
            return None
        last = artifacts.read(self._directory, _name(stage, lane, "safetensors"))
        try:
            result, wanted = decode_result(lane, text), decode_digest(text, "last")
        except DecodeError:
            return None
        if wanted is not None and damaged(last, wanted):
            return None
        return result.holding({"last": last} if last is not None else {})


def _name(stage: int, lane: str, suffix: str) -> str:
    return f"lanes/{lane}/stage{stage}.{suffix}"
