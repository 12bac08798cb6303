"""What every language model must do. Inherit, make the model, and let pytest collect it:

class TestMyModel(ModelConformance):
    def make(self) -> LanguageModel:
        return MyModel("http://localhost:8000")
"""

from __future__ import annotations

from collections.abc import Iterator

from openeureka.llm.client import LanguageModel
from openeureka.types import Message, Prompt, Reply


class ModelConformance:
    """Checks that hold for any model; what the model says is a matter for its own tests."""

    def make(self) -> LanguageModel:
        """A fresh model, able to give at least six replies."""
        raise NotImplementedError

    def prompt(self) -> Prompt:
        """A short prompt in the model's style; for the style `grammar`, with a grammar and a prefill."""
        return Prompt(messages=(Message("system", "Answer briefly."), Message("user", "Say yes.")))

    def test_style_is_one_that_prompts_are_written_in(self) -> None:
        model = self.make()
        assert model.style in ("free", "grammar")
        assert model.name

    def test_it_gives_as_many_replies_as_asked(self) -> None:
        assert len(self._replies(self.make(), 3)) == 3

    def test_it_yields_replies_one_by_one(self) -> None:
        # A caller commits each before it takes the next, so a list would lose all of them when it is killed.
        assert isinstance(self.make().sample(self.prompt(), n=2, seed=0), Iterator)

    def test_replies_name_the_model_and_count_what_they_cost(self) -> None:
        for reply in self._replies(self.make(), 2):
            assert reply.model
            assert min(reply.usage.prompt_tokens, reply.usage.completion_tokens, reply.usage.cost_usd) >= 0
            assert reply.seconds >= 0

    def test_replies_begin_with_the_prefill(self) -> None:
        prefill = self.prompt().prefill
        assert all(reply.text.startswith(prefill) for reply in self._replies(self.make(), 2))

    def test_it_works_again_after_close(self) -> None:
        model = self.make()
        self._replies(model, 1)
        model.close()
        model.close()
        assert len(self._replies(model, 2)) == 2

    def test_a_request_that_is_given_up_does_not_spoil_the_next(self) -> None:
        model = self.make()
        request = model.sample(self.prompt(), n=3, seed=0)
        next(iter(request))
        del request
        assert len(self._replies(model, 1)) == 1

    def _replies(self, model: LanguageModel, n: int) -> list[Reply]:
        try:
            return list(model.sample(self.prompt(), n=n, seed=0))
        finally:
            model.close()
