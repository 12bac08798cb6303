"""What replies cost."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from importlib.resources import files

from ..errors import ConfigError


@dataclass(frozen=True, slots=True)
class Price:
    """US dollars per million tokens."""

    input: float
    output: float

    def of(self, prompt_tokens: float, completion_tokens: float) -> float:
        """US dollars."""
        return (self.input * prompt_tokens + self.output * completion_tokens) / 1e6


def find(model: str, stated: str = "") -> Price | None:
    """The `stated` price (`INPUT,OUTPUT`), else that of the table; None where neither knows the model.

    Raises:
        ConfigError: when `stated` is not two numbers.
    """
    if stated:
        return _stated(stated)
    table = tomllib.loads((files("openeureka.llm") / "prices.toml").read_text())["models"]
    # `gpt-4o-2024-08-06` is a `gpt-4o`, but `gpt-5-pro` is no `gpt-5`.
    base = re.sub(r"-(\d{4}-\d{2}-\d{2}|\d{4}|latest)$", "", model)
    return Price(*table[base]) if base in table else None


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
