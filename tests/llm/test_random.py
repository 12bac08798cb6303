import re

import pytest

from openeureka.errors import ModelError
from openeureka.llm import grammar
from openeureka.llm.random import RandomModel, named
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


def test_components_are_named_by_what_they_measure():
    drawn = (
        " qX\n    reward = torch.zeros_like(up)\n"
        "    # abc\n    x = torch.exp(-torch.abs(up) / 0.5)\n    reward = reward + 1.0 * x\n"
        '    components["f_a"] = x\n'
        "    # b,c\n    x = torch.clamp(speed[:, 1], min=0.0, max=2.0)\n    reward = reward + 0.5 * x\n"
        '    components["kiy"] = x\n'
        "    # c\n    x = torch.exp(-torch.norm(up, dim=-1) / 0.1)\n    reward = reward + 0.2 * x\n"
        '    components["f_a"] = x\n    return reward, components\n```'
    )
    text = named(drawn)
    assert text.startswith(" drawn at random\n    reward = torch.zeros_like(up)\n    # up close\n")
    found = re.findall(r'components\["(\w+)"\]', text)
    assert found == ["up_close", "speed_1_bounded", "up_close_2"]


def test_progress_is_named_by_what_it_measures():
    drawn = (
        '    # abc\n    components["progress_qx"] = torch.exp(-torch.abs(up) / 0.5)\n'
        '    # b\n    components["progress_qx"] = torch.exp(-torch.abs(up) / 0.1)\n'
        "    # abc\n    x = torch.exp(-torch.abs(up) / 0.5)\n    reward = reward + 1.0 * x\n"
        '    components["f_a"] = x\n'
    )
    text = named(drawn)
    found = re.findall(r'components\["(\w+)"\]', text)
    assert found == ["progress_up_close", "progress_up_close_2", "up_close"]
    assert (
        '    # progress up close 2\n    components["progress_up_close_2"] = torch.exp(-torch.abs(up) / 0.1)\n' in text
    )


def test_no_name_of_a_draw_is_chance():
    known = set(re.findall(r"\w+", " ".join(variable.name for variable in ANT.variables)))
    for text in texts(32, seed=5):
        names = re.findall(r'components\["(\w+)"\]', text)
        assert names and len(set(names)) == len(names)
        assert all(any(name.startswith(variable[:20]) for variable in known) for name in names), names
