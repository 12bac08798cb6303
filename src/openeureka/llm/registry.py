"""From `model=` to a language model."""

from __future__ import annotations

import difflib
import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from ..config import NO_MODEL, RunConfig
from ..errors import ConfigError, ModelError, StoreError
from ..plugins import Door
from ..types import Prompt, Reply, Style
from . import hub, price, weights
from .client import LanguageModel
from .local import LocalModel, expect_engine
from .random import RandomModel

KINDS = ("local", "random", "replay")
"""Models that need no endpoint."""
MODELS = Door(setting="model", group="openeureka.models", built_in={}, members=("name", "style", "sample", "close"))
"""Models from outside this package: functions that make a `LanguageModel` from the settings of a run."""


def expect_model(model: object) -> None:
    """Raises ConfigError for an object that is no `LanguageModel`."""
    if missing := [name for name in MODELS.members if not hasattr(model, name)]:
        raise ConfigError(
            f"`model` takes an object with {', '.join(MODELS.members)}; {type(model).__name__} has no "
            f"{', '.join(missing)}."
        )


def open_model(config: RunConfig, *, held: int = 0) -> LanguageModel:
    """The model that `config.model` names. Costly things (weights, processes, sockets) wait for the first sample.

    `local`, `local:PATH.gguf`, `local:hub:OWNER/REPO/FILE.gguf`, `random`, `replay:RUN`, `replay:FILE.json`,
    `pkg.mod:factory` or `FILE.py:factory` (a function from RunConfig to a model), a name that an installed package
    adds, or the name of a model at an OpenAI-compatible endpoint.

    Args:
        held: replies that the run already has; a replaying model goes on after them.

    Raises:
        ModelError, ConfigError, StoreError: it names, or needs, something that is not there.
    """
    kind, _, rest = config.model.partition(":")
    if kind == "local":
        return _local(config, rest)
    if config.model == "random":
        return RandomModel()
    if kind == "replay":
        return _replay(config, rest, held)
    if not config.base_url and (_is_import(*config.model.rpartition(":")[::2]) or MODELS.installed(config.model)):
        return priced(MODELS.make(config.model, config), config)
    return _endpoint(config)


def _is_import(module: str, name: str) -> bool:
    """Whether `module:name` names Python code. Models of endpoints may have a colon too: `llama3.2:latest`."""
    parts, found = module.split("."), False
    with suppress(ValueError):  # a module without a spec, such as `__main__`
        found = all(map(str.isidentifier, parts)) and (len(parts) > 1 or find_spec(module) is not None)
    return bool(name) and (found or module.endswith(".py"))


def is_plain(model: str) -> bool:
    """Whether a value of `model=` is only a name: one that cannot pick a file, a download or code to run."""
    if model in KINDS or MODELS.installed(model):
        return True
    module, _, name = model.rpartition(":")
    return model.partition(":")[0] not in KINDS and not _is_import(module, name)


def expect(config: RunConfig) -> None:
    """Refuse a new run whose embedded model is missing. A run that is resumed may need no more replies.

    Raises:
        ModelError, ConfigError: it names no weights.
    """
    kind, _, where = config.model.partition(":")
    if kind == "local" and where.startswith("hub:"):
        hub.parsed(where.removeprefix("hub:"))
    elif kind == "local" and where:
        weights.existing(Path(where))


def _local(config: RunConfig, where: str) -> LanguageModel:
    expect_engine()
    if where.startswith("hub:"):
        find = partial(hub.fetch, where.removeprefix("hub:"))
    elif where:
        find = partial(weights.existing, Path(where))
    else:
        weights.expect_default()
        find = weights.default
    return LocalModel(find, name=config.model, temperature=config.temperature, threads=config.threads)


def _replay(config: RunConfig, where: str, held: int) -> LanguageModel:
    from ..store import read_config, read_replies

    if not where:
        raise ConfigError(
            "`model=replay:` must name the directory of a run, for example model=replay:outputs/RUN, or a JSON file."
        )
    if not where.endswith(".json"):
        recorded = read_config(where).model
        if recorded == NO_MODEL:
            raise ConfigError(f"{where} compares given rewards, and holds no replies; name the directory of a search.")
        return ReplayModel(read_replies(where), _style(recorded), held=held)
    if config.hearings:
        raise ConfigError(f"{where} holds replies but no person's remarks: leave feedback=human out.")
    return ReplayModel(archived(Path(where)), "free", held=held)


def _style(recorded: str) -> Style:
    """The style in which a run's model was asked: that of a replay is the style of the replayed run, if it exists."""
    from ..store import read_config

    seen = set[str]()
    while recorded.startswith("replay:") and recorded not in seen:  # a copied or changed run may lead back to itself
        seen.add(recorded)
        with suppress(OSError, StoreError):
            recorded = read_config(recorded.removeprefix("replay:")).model
    return "grammar" if recorded.partition(":")[0] in ("local", "random") else "free"


def archived(path: Path) -> list[Reply]:
    """The replies of a JSON file, `{"model": NAME, "replies": [TEXT, ...]}`, in their order. Raises ConfigError for any
    other file."""
    try:
        found = json.loads(path.read_text(encoding="utf-8-sig"))
        name, texts = found["model"], found["replies"]
    except OSError as error:
        raise ConfigError(f"Cannot read the replies in {path}: {error.strerror}.") from None
    except (ValueError, LookupError, TypeError):
        name, texts = None, None
    if not isinstance(name, str) or not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
        raise ConfigError(f'{path} is not a file of replies: it must hold {{"model": NAME, "replies": [TEXT, ...]}}.')
    return [Reply(text=text, model=name) for text in texts]


def priced(model: LanguageModel, config: RunConfig) -> LanguageModel:
    """A user's own model, with replies priced as the settings say.

    Raises:
        ConfigError: there is a limit on costs, and nobody knows what the model costs.
    """
    if config.model.partition(":")[0] in KINDS:  # a built-in one, handed over as an object: it costs nothing
        return model
    known = _price(config, ", or price=0,0 if the model reports its own costs")
    return model if known is None else PricedModel(model, known)


def _price(config: RunConfig, otherwise: str = "") -> price.Price | None:
    known = price.find(config.model, config.price)
    if known is None and config.max_cost:
        raise ConfigError(
            f"The price of {config.model} is not known, so max_cost cannot be enforced; add price=INPUT,OUTPUT"
            f"{otherwise}."
        )
    return known


def _endpoint(config: RunConfig) -> LanguageModel:
    url = config.base_url or os.environ.get("OPENAI_BASE_URL", "").strip()
    meant = difflib.get_close_matches(config.model.partition(":")[0].lower(), KINDS, n=1, cutoff=0.75)
    if meant and not url:
        raise ConfigError(
            f"There is no model `{config.model}`. Did you mean `{meant[0]}`? A model at an endpoint needs base_url=."
        )
    if url and not re.match(r"https?://[^/]", url):
        bare = re.sub(r"^[a-z]*:?/+", "", url) or "localhost:8000/v1"
        raise ConfigError(f"`base_url` must begin with http:// or https://: write base_url=http://{bare}")
    from .openai import EndpointModel  # the package takes a second to import, and only this needs it

    return EndpointModel(config.model, base_url=url, temperature=config.temperature, price=_price(config))


class PricedModel:
    """A user's own model. Replies that state no cost get one: their tokens at the price that the settings name."""

    def __init__(self, model: LanguageModel, known: price.Price) -> None:
        self.name = model.name
        self.style: Style = model.style
        self._model, self._price = model, known

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        """Yield the model's replies, priced."""
        for reply in self._model.sample(prompt, n=n, seed=seed):
            usage = reply.usage
            cost = usage.cost_usd or self._price.of(usage.prompt_tokens, usage.completion_tokens)
            yield replace(reply, usage=replace(usage, cost_usd=cost))

    def close(self) -> None:
        self._model.close()


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
