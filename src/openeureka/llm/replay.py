"""Replies of an earlier run or of a file, given again in place of a model's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from ..codec import decode
from ..config import NO_MODEL, RunConfig
from ..errors import ConfigError, ModelError, StoreError
from ..store import read_config, read_replies
from ..types import Prompt, Reply, Style


class ReplayModel:
    """Re-runs a search offline. Replies were paid for once, so they cost nothing here.

    Args:
        replies: all replies of the other run, in its order.
        style: of the model that wrote them.
        held: how many of them this run already has, when it is resumed.
    """

    name = "replay"

    def __init__(self, replies: Sequence[Reply], style: Style, *, held: int = 0) -> None:
        self.style: Style = style
        self._replies = replies
        self._next = held

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        """Yield the next n replies, whatever the prompt asks. Raises ModelError where the recording has no more."""
        for _ in range(n):
            if self._next >= len(self._replies):
                raise ModelError(
                    f"The replay holds {len(self._replies)} replies, but this run needs more; give it the same "
                    "env, sample, iteration, refill, search and seed."
                )
            reply = self._replies[self._next]
            self._next += 1
            yield replace(reply, usage=replace(reply.usage, cost_usd=0.0))

    def close(self) -> None:
        """Holds nothing."""


def recorded(config: RunConfig, where: str, *, held: int) -> ReplayModel:
    """The model of `model=replay:` and `where`, the directory of a run or a JSON file of replies.

    Args:
        held: replies that the run already has, when it is resumed.

    Raises:
        ConfigError, StoreError: there are no replies.
    """
    if not where:
        raise ConfigError(
            "`model=replay:` must name the directory of a run, for example model=replay:outputs/RUN, or a JSON file."
        )
    if not where.endswith(".json"):
        model = read_config(where).model
        if model == NO_MODEL:
            raise ConfigError(f"{where} compares given rewards, and holds no replies; name the directory of a search.")
        return ReplayModel(read_replies(where), _style(model), held=held)
    if config.hearings:
        raise ConfigError(f"{where} holds replies but no person's remarks: leave feedback=human out.")
    return ReplayModel(archived(Path(where)), "free", held=held)


def _style(model: str) -> Style:
    """The style in which a run's model was asked: that of a replay is the style of the replayed run, if it exists."""
    seen = set[str]()
    while model.startswith("replay:") and model not in seen:  # a copied or changed run may lead back to itself
        seen.add(model)
        with suppress(OSError, StoreError):
            model = read_config(model.removeprefix("replay:")).model
    return "grammar" if model.partition(":")[0] in ("local", "random") else "free"


def archived(path: Path) -> list[Reply]:
    """The replies of a JSON file, `{"model": NAME, "replies": [TEXT, ...]}`, in their order. Raises ConfigError for any
    other file."""
    try:
        found = decode(_Archive, path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise ConfigError(f"Cannot read the replies in {path}: {error.strerror}; check its path.") from None
    except ValueError:
        raise ConfigError(
            f'{path} is not a file of replies: it must hold {{"model": NAME, "replies": [TEXT, ...]}}.'
        ) from None
    return [Reply(text=text, model=found.model) for text in found.replies]


@dataclass(frozen=True, slots=True)
class _Archive:
    model: str
    replies: tuple[str, ...]
