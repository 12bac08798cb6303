"""Prompts to language models, and their replies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from .rewards import Candidate

Style = Literal["free", "grammar"]
"""How a model writes: as it likes, or a text that the grammar of its prompt derives."""


@dataclass(frozen=True, slots=True)
class Message:
    """One turn of a conversation."""

    role: Literal["system", "user", "assistant"]
    content: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Prompt:
    """What a model is asked. `grammar` (GBNF) and `prefill` are set only for models whose style is `grammar`: the reply
    then is `prefill` plus text that the grammar derives."""

    messages: tuple[Message, ...]
    grammar: str | None = None
    prefill: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """Cost of a reply; tokens that several replies share are counted with one of them."""

    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost_usd: float = 0.0

    def __add__(self, other: Usage) -> Usage:
        return Usage(
            prompt_tokens=self.prompt_tokens + other.prompt_tokens,
            completion_tokens=self.completion_tokens + other.completion_tokens,
            cost_usd=self.cost_usd + other.cost_usd,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """One completed sample, text as received (prefill included)."""

    text: str
    model: str
    usage: Usage = Usage()
    seconds: float = 0.0


GIVEN = "given"
"""`Reply.model` of a reward that the run began with: no model was asked for it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """The program that a reply holds."""

    candidate: Candidate | None
    """None where the reply holds no program."""
    repair: tuple[Message, ...] = ()
    """Messages after the slot's prompt that asked the model to repair a refused program; empty for a fresh sample."""
