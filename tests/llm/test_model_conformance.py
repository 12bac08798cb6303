from collections.abc import Iterator
from pathlib import Path

import pytest

from openeureka.llm import grammar, local
from openeureka.llm.client import LanguageModel
from openeureka.llm.local import LocalModel
from openeureka.llm.random import RandomModel
from openeureka.llm.replay import ReplayModel
from openeureka.testing.conformance.model import ModelConformance
from openeureka.types import Message, Prompt, Reply

from .specs import ANT
from .test_openai import Endpoint, answer


class GrammarPrompt:
    def prompt(self) -> Prompt:
        return Prompt(
            messages=(Message("user", "Say yes."),), grammar=grammar.grammar(ANT), prefill=grammar.prefill(ANT)
        )


class TestRandom(GrammarPrompt, ModelConformance):
    def make(self) -> LanguageModel:
        return RandomModel()


class TestReplay(ModelConformance):
    def make(self) -> LanguageModel:
        return ReplayModel([Reply(text=str(i), model="m") for i in range(6)], "free")


class TestLocal(GrammarPrompt, ModelConformance):
    @pytest.fixture(autouse=True)
    def fake(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(local, "_SERVER", "fake_server")
        monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))

    def make(self) -> LanguageModel:
        return LocalModel(lambda: Path("works"))


class TestEndpoint(ModelConformance):
    @pytest.fixture(autouse=True)
    def endpoint(self) -> Iterator[None]:
        self.served = Endpoint()
        self.served.script = lambda body: answer(*["yes"] * body.get("n", 1))
        yield
        self.served.server.shutdown()
        self.served.server.server_close()

    def make(self) -> LanguageModel:
        return self.served.model()
