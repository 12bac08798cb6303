"""Nouns as JSON text and back: the one format of stores, of frames between processes and of graphs.

Output is strict JSON in ASCII, lone surrogates included, so that any file and any database can hold it. Input may come
from anyone: `decode` returns the noun that was asked for, checked field by field, or raises `DecodeError`. Missing
fields get their defaults; unknown ones are dropped.

A number that is not finite is written `{"float": "inf"}`. Graphs in runs of older versions hold the token `Infinity`,
which is read as well. Any other number of a noun has a type that refuses both.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeVar, cast

import msgspec

T = TypeVar("T")
_SPELLED = ("inf", "-inf", "nan")


class DecodeError(ValueError):
    """Text or data that is not the noun it should be."""


def encode(noun: object, *, indent: int | None = None) -> str:
    """A noun, or lists and dictionaries of nouns, as JSON text."""
    data = _numbers(to_builtins(noun), lambda number: {"float": str(number)})
    return json.dumps(data, allow_nan=False, indent=indent)


def decode(kind: type[T], text: str | bytes) -> T:
    """Inverse of `encode`.

    Raises:
        DecodeError: for anything else, however deep or long.
    """
    return convert(kind, _parsed(text))


def _parsed(text: str | bytes) -> Any:
    # msgspec takes a sixth of the time over curves. It refuses numbers that are not finite, and lone surrogates.
    odd = b'"float"' in text if isinstance(text, bytes) else '"float"' in text
    if not odd:
        with suppress(ValueError, RecursionError):
            return msgspec.json.decode(text)
    try:
        return json.loads(text, object_hook=_read_float)
    except (ValueError, RecursionError) as error:
        raise _refusal(error) from None


def to_builtins(noun: object) -> Any:
    """A noun as dictionaries, lists, text and numbers."""
    return msgspec.to_builtins(noun)


def to_finite(noun: object) -> Any:
    """As `to_builtins`, with None in place of numbers that are not finite: an undefined number never becomes 0."""
    return _numbers(to_builtins(noun), lambda _: None)


def convert(kind: type[T], data: object) -> T:
    """Inverse of `to_builtins`. Raises DecodeError where the data is not such a noun."""
    try:
        return msgspec.convert(data, kind)
    except (ValueError, RecursionError) as error:
        raise _refusal(error) from None


def _refusal(error: Exception) -> DecodeError:
    return DecodeError(f"{error}"[:200])


def _numbers(data: Any, odd: Callable[[float], Any]) -> Any:
    """The same data with another value for each number that is not finite."""
    if isinstance(data, float):
        return data if math.isfinite(data) else odd(data)
    if isinstance(data, dict):
        return {key: _numbers(value, odd) for key, value in cast(dict[str, Any], data).items()}
    if isinstance(data, list | tuple):
        return [_numbers(value, odd) for value in cast(Sequence[Any], data)]
    return data


def _read_float(data: dict[str, Any]) -> Any:
    return float(data["float"]) if len(data) == 1 and data.get("float") in _SPELLED else data
