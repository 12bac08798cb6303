"""The baseline without a model: random reward programs of the typed grammar."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import Literal

from ..errors import ModelError
from ..types import Prompt, Reply
from . import gbnf

_TRIES = 100


class RandomModel:
    """Draws strings of the prompt's grammar and reads nothing else of the prompt.

    The honest control for the embedded model: whatever a search with this finds, selection found.
    """

    name = "random"
    style: Literal["free", "grammar"] = "grammar"

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        """Yield n different replies, always the same ones for a prompt and a seed."""
        if prompt.grammar is None:
            raise ValueError("the random model needs a prompt with a grammar")
        rules = gbnf.parse(prompt.grammar)
        random = Random(seed)
        seen: set[str] = set()
        for _ in range(n * _TRIES):
            if len(seen) == n:
                return
            text = gbnf.derive(rules, random)
            if text not in seen:
                seen.add(text)
                yield Reply(text=prompt.prefill + text, model=self.name)
        if len(seen) < n:
            raise ModelError(f"The grammar of this task has fewer than {n} programs; lower sample=.")

    def close(self) -> None:
        """Holds nothing."""
