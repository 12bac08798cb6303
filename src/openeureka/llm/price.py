"""What replies cost, and what may be spent on them."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files

from ..errors import BudgetError, ConfigError
from ..types import Prompt, Reply

_FIRST_GUESS = 1500
"""Tokens that a reply is expected to have before the first one has come."""
CHARACTERS = 4
"""Characters of a token, roughly."""


@dataclass(frozen=True, slots=True)
class Price:
    """US dollars per million tokens."""

    input: float
    output: float

    def of(self, prompt_tokens: float, completion_tokens: float) -> float:
        """US dollars."""
        return (self.input * prompt_tokens + self.output * completion_tokens) / 1e6


def find(model: str, stated: str = "") -> Price | None:
    """The `stated` price (`INPUT,OUTPUT`), else that of the table; None where neither knows the model. Raises
    ConfigError when `stated` is not two numbers."""
    if stated:
        return _stated(stated)
    table = tomllib.loads((files("openeureka.llm") / "prices.toml").read_text())["models"]
    # `gpt-4o-2024-08-06` is a `gpt-4o`, but `gpt-5-pro` is no `gpt-5`.
    base = re.sub(r"-(\d{4}-\d{2}-\d{2}|\d{4}|latest)$", "", model)
    known = table.get(model, table.get(base))
    return Price(*known) if known is not None else None


def afford(limit: float, replies: Sequence[Reply], price: Price | None, prompt: Prompt, count: int) -> None:
    """Stop before asking for `count` replies that are expected to exceed the limit.

    A reply is expected to cost the mean of those so far that cost anything. Before the first of these, its cost is
    guessed from the price, if that is known.

    Args:
        limit: US dollars for the whole run.
        replies: all that the run has.

    Raises:
        BudgetError: with what is spent and what the replies would cost.
    """
    costs = [reply.usage.cost_usd for reply in replies if reply.usage.cost_usd]
    spent = sum(costs)
    if costs:
        expected = spent / len(costs) * count
    else:
        asked = sum(len(message.content) for message in prompt.messages) / CHARACTERS
        expected = price.of(asked, _FIRST_GUESS * count) if price is not None else 0.0
    if spent + expected > limit:
        raise BudgetError(
            f"{count} more replies would cost about {expected:.2f} US dollars and exceed max_cost={limit:g}: "
            f"{spent:.2f} are spent already. Nothing is lost; resume with a higher max_cost=."
        )


def _stated(text: str) -> Price:
    try:
        values = [float(number) for number in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 2 or not all(0 <= value < float("inf") for value in values):
        raise ConfigError(
            f"`price={text}` must be two numbers, US dollars per million tokens in and out: price=2.5,10."
        )
    return Price(*values)
