"""The one interface every language model is used through."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from ..types import Prompt, Reply, Style


class LanguageModel(Protocol):
    """A source of replies.

    `style` says which prompt it wants: `free` text, or `grammar` (prefilled, derived from `Prompt.grammar`).
    """

    name: str
    style: Style

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        """Yield n replies as they complete, in any order.

        Raises:
            ModelError: when the model cannot answer; replies yielded before stay valid.
        """
        ...

    def close(self) -> None:
        """Free memory and processes; the next `sample` starts them again."""
        ...
