"""From `model=` to a language model."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from ..config import RunConfig
from ..errors import ConfigError
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
        from .replay import recorded  # which needs the store

        return recorded(config, rest, held=held)
    if not config.base_url and (_is_import(config.model) or MODELS.installed(config.model)):
        return priced(MODELS.make(config.model, config), config)
    return _endpoint(config)


def _is_import(model: str) -> bool:
    """Whether `MODULE:NAME` names Python code. Models of endpoints may have a colon too: `llama3.2:latest`."""
    module, _, name = model.rpartition(":")
    parts, found = module.split("."), False
    with suppress(ValueError):  # a module without a spec, such as `__main__`
        found = all(map(str.isidentifier, parts)) and (len(parts) > 1 or find_spec(module) is not None)
    return bool(name) and (found or module.endswith(".py"))


def is_plain(model: str) -> bool:
    """Whether a value of `model=` is only a name: one that cannot pick a file, a download or code to run."""
    if model in KINDS or MODELS.installed(model):
        return True
    return model.partition(":")[0] not in KINDS and not _is_import(model)


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
