"""Watching torch's operations without loading its compiler."""

from __future__ import annotations

from torch.utils._python_dispatch import TorchDispatchMode


class Mode(TorchDispatchMode):
    """A dispatch mode that does without `torch.compile`: its import costs a process two seconds and 70 MB."""

    def __init__(self) -> None:
        super().__init__()  # pyright: ignore[reportUnknownMemberType]

    @classmethod
    def _should_skip_dynamo(cls) -> bool:
        return False
