"""Finished stages of lanes: a result and a policy beside the lane's other files."""

from __future__ import annotations

from pathlib import Path

from ..codec import DecodeError
from ..types import TrainingResult
from . import artifacts
from .codec import decode_result, encode_result


class StageFiles:
    """Remembers stages as `lanes/<lane>/stage<number>.json` and, of a lane that goes on, its last policy beside it.

    The policy comes first: a stage whose JSON is there is whole. One that cannot be read is not finished.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory

    def save(self, stage: int, result: TrainingResult) -> None:
        if result.last is not None:
            artifacts.write(self._directory, self._name(stage, result.lane, "safetensors"), result.last)
        artifacts.write(self._directory, self._name(stage, result.lane, "json"), encode_result(result))

    def read(self, stage: int, lane: str) -> TrainingResult | None:
        """The result with its last policy, the others empty; None when the stage was not finished."""
        text = artifacts.read(self._directory, self._name(stage, lane, "json"))
        if text is None:
            return None
        last = artifacts.read(self._directory, self._name(stage, lane, "safetensors"))
        try:
            result = decode_result(lane, text)
        except DecodeError:
            return None
        return result.holding({"last": last} if last is not None else {})

    def _name(self, stage: int, lane: str, suffix: str) -> str:
        return f"lanes/{lane}/stage{stage}.{suffix}"
