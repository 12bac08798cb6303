import json
import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from openeureka.config import NO_MODEL, RunConfig
from openeureka.errors import ConfigError, EurekaError, ModelError
from openeureka.llm import local, open_model, registry, weights
from openeureka.llm.random import RandomModel
from openeureka.store import Store
from openeureka.types import Message, Prompt, Reply, Usage


def scripted(config: RunConfig) -> RandomModel:
    """A factory that an import string may name."""
    return RandomModel()


@pytest.mark.parametrize(
    ("model", "style"),
    [
        ("local", "grammar"),
        ("local:any.gguf", "grammar"),
        ("local:hub:owner/repo/file.gguf", "grammar"),
        ("random", "grammar"),
        ("gpt-5", "free"),
        ("ft:gpt-4o:me", "free"),
        (f"{__name__}:scripted", "grammar"),
    ],
)
def test_model_names_what_it_says_and_opening_costs_nothing(model: str, style: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("OPENAI_API_KEY", "sk-none")
    monkeypatch.setattr(registry, "expect_engine", lambda: None)
    monkeypatch.setattr(weights, "expect_default", lambda: None)
    opened = open_model(RunConfig(model=model))
    assert opened.style == style
    opened.close()


def test_at_an_endpoint_of_its_own_a_name_may_hold_a_colon():
    assert open_model(RunConfig(model="qwen2.5:7b", base_url="http://127.0.0.1:1/v1")).name == "qwen2.5:7b"


def test_a_limit_needs_a_price():
    settings = {"model": "m", "base_url": "http://127.0.0.1:1/v1", "max_cost": 1.0}
    with pytest.raises(ConfigError, match="add price=INPUT,OUTPUT"):
        open_model(RunConfig(**settings))
    open_model(RunConfig(**settings, price="1,2")).close()


class Counting(RandomModel):
    """Three replies: two of 1000 tokens in and 200 out, of which the second states its cost, and one without counts."""

    name = "counting"

    def __init__(self, config: RunConfig):
        super().__init__()

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        counted = Usage(prompt_tokens=1000, completion_tokens=200)
        for usage in (counted, replace(counted, cost_usd=0.5), Usage()):
            yield Reply(text="x", model=self.name, usage=usage)


def test_a_model_of_ones_own_costs_what_price_says():
    def costs(**settings: Any) -> list[float]:
        model = open_model(RunConfig(model=f"{__name__}:Counting", **settings))
        assert (model.name, model.style) == ("counting", "grammar")
        return [reply.usage.cost_usd for reply in model.sample(Prompt(messages=()), n=3, seed=0)]

    # 1000 tokens at 2 $/M and 200 at 10 $/M: 0.002 + 0.002
    assert costs(price="2,10", max_cost=1.0) == pytest.approx([0.004, 0.5, 0.0])
    assert costs(price="0,0", max_cost=1.0) == costs() == [0.0, 0.5, 0.0]
    with pytest.raises(ConfigError, match=r"max_cost cannot be enforced; add price=INPUT,OUTPUT, or price=0,0 if"):
        costs(max_cost=1.0)


def test_a_missing_weights_file_is_said_when_it_is_needed(tmp_path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(registry, "expect_engine", lambda: None)
    model = open_model(RunConfig(model=f"local:{tmp_path}/none.gguf"))
    with pytest.raises(ModelError, match="cannot be read"):
        list(model.sample(Prompt(messages=(Message("user", "hi"),)), n=1, seed=0))


def test_an_embedded_model_that_is_not_installed_is_refused_when_it_is_opened(tmp_path, monkeypatch):
    monkeypatch.setattr(local, "find_spec", lambda name: None)
    with pytest.raises(ModelError, match=r"xllamacpp is not installed.*pip install 'openeureka\[local\]'"):
        open_model(RunConfig(model="local"))

    monkeypatch.setattr(local, "find_spec", lambda name: object())
    monkeypatch.delenv("EUREKA_GGUF", raising=False)
    monkeypatch.setenv("EUREKA_CACHE", str(tmp_path))
    monkeypatch.setattr(weights, "QWEN", replace(weights.QWEN, package="no-such-package-"))
    with pytest.raises(ModelError, match="weights of the embedded model are not installed"):
        open_model(RunConfig(model="local"))


def unfinished(config: RunConfig) -> object:
    return object()


@pytest.mark.parametrize(
    ("model", "says"),
    [
        ("no.such:factory", "cannot be imported: ModuleNotFoundError: .* Put the folder that holds it on PYTHONPATH"),
        (f"{__name__}:nothing", "no class or function `nothing`"),
        (f"{__name__}:json", "no class or function `json`"),
        (f"{__name__}:Path.cwd", "no class or function"),
        (f"{__name__}:test_a_limit_needs_a_price", "cannot be called with"),
        (f"{__name__}:unfinished", "makes lacks name, style, sample, close"),
    ],
)
def test_an_import_string_that_leads_nowhere_is_one_sentence(model: str, says: str):
    with pytest.raises(ConfigError, match=says):
        open_model(RunConfig(model=model))


def test_a_module_that_is_found_needs_no_package_around_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "my_model_of_one_file.py").write_text(f"from {__name__} import scripted as made\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert isinstance(open_model(RunConfig(model="my_model_of_one_file:made")), RandomModel)
    monkeypatch.setenv("OPENAI_API_KEY", "sk-none")
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", None)  # as in a script
    for name in ("__main__:y", "llama3:latest", "llama3.2:latest", "qwen2.5-coder:1.5b"):
        assert open_model(RunConfig(model=name)).name == name


def test_a_run_without_a_model_has_nothing_to_replay(tmp_path: Path):
    with Store.open(tmp_path, RunConfig(model=NO_MODEL)):
        pass
    with pytest.raises(ConfigError, match="compares given rewards, and holds no replies"):
        open_model(RunConfig(model=f"replay:{tmp_path}"))


@pytest.mark.parametrize(("root", "style"), [("random", "grammar"), ("gpt-5", "free"), ("replay:{}/third", "free")])
def test_a_replay_of_a_replay_asks_as_the_first_run_did(tmp_path: Path, root: str, style: str):
    models = [root.format(tmp_path), f"replay:{tmp_path}/first", f"replay:{tmp_path}/second"]
    for name, model in zip(("first", "second", "third"), models, strict=True):
        Store.open(tmp_path / name, RunConfig(model=model)).close()
    assert open_model(RunConfig(model=f"replay:{tmp_path}/third")).style == style
    shutil.rmtree(tmp_path / "first")
    assert open_model(RunConfig(model=f"replay:{tmp_path}/third")).style == "free"


def test_a_file_of_replies_gives_them_in_order(tmp_path: Path):
    file = tmp_path / "ant.json"
    file.write_text(json.dumps({"model": "strong", "replies": ["one", "two", "three"]}))
    model, prompt = open_model(RunConfig(model=f"replay:{file}"), held=1), Prompt(messages=(Message("user", "any"),))
    assert [(reply.text, reply.model) for reply in model.sample(prompt, n=2, seed=0)] == [
        ("two", "strong"),
        ("three", "strong"),
    ]
    with pytest.raises(ModelError, match="holds 3 replies"):
        list(model.sample(prompt, n=1, seed=0))
    with pytest.raises(ConfigError, match="leave feedback=human out"):
        open_model(RunConfig(model=f"replay:{file}", feedback="human", iteration=2))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"model": "a", "replies": "b"}', '{"model": "a", "replies": [1]}'])
def test_a_file_of_anything_else_is_refused(tmp_path: Path, text: str):
    (tmp_path / "ant.json").write_text(text)
    with pytest.raises(ConfigError, match="is not a file of replies: it must hold"):
        open_model(RunConfig(model=f"replay:{tmp_path}/ant.json"))
    with pytest.raises(ConfigError, match="Cannot read the replies"):
        open_model(RunConfig(model=f"replay:{tmp_path}/none.json"))


def test_a_replay_must_name_a_run(tmp_path):
    with pytest.raises(ConfigError, match="replay:outputs/RUN"):
        open_model(RunConfig(model="replay:"))
    with pytest.raises(EurekaError):
        open_model(RunConfig(model=f"replay:{tmp_path}/none"))
