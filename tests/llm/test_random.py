import pytest

from openeureka.errors import ModelError
from openeureka.llm import grammar
from openeureka.llm.random import RandomModel
from openeureka.types import Prompt

from .specs import ANT

PROMPT = Prompt(messages=(), grammar=grammar.grammar(ANT), prefill=grammar.prefill(ANT))


def texts(n: int, seed: int) -> list[str]:
    return [reply.text for reply in RandomModel().sample(PROMPT, n=n, seed=seed)]


def test_replies_are_distinct_and_begin_with_the_prefill():
    drawn = texts(64, seed=1)
    assert len(set(drawn)) == 64
    assert all(text.startswith(PROMPT.prefill) and text.endswith("```") for text in drawn)


def test_the_same_seed_draws_the_same_and_another_seed_other_replies():
    assert texts(8, seed=3) == texts(8, seed=3)
    assert not set(texts(8, seed=3)) & set(texts(8, seed=4))


def test_a_language_that_is_too_small_is_an_error():
    tiny = Prompt(messages=(), grammar='root ::= "a" | "b"')
    model = RandomModel()
    assert {reply.text for reply in model.sample(tiny, n=2, seed=0)} == {"a", "b"}
    with pytest.raises(ModelError, match="fewer than 3 programs"):
        list(model.sample(tiny, n=3, seed=0))
