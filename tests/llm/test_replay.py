import pytest

from openeureka.errors import ModelError
from openeureka.llm.replay import ReplayModel
from openeureka.types import Prompt, Reply, Usage

PROMPT = Prompt(messages=())
RECORDED = [Reply(text=str(i), model="m", usage=Usage(prompt_tokens=i, cost_usd=0.5)) for i in range(5)]


def texts(model: ReplayModel, n: int) -> list[str]:
    return [reply.text for reply in model.sample(PROMPT, n=n, seed=0)]


def test_replies_come_in_recorded_order_across_requests():
    model = ReplayModel(RECORDED, "free")
    assert (texts(model, 2), texts(model, 3)) == (["0", "1"], ["2", "3", "4"])


def test_a_resumed_run_goes_on_after_what_it_holds():
    assert texts(ReplayModel(RECORDED, "free", held=3), 2) == ["3", "4"]


def test_tokens_are_kept_and_nothing_is_paid_twice():
    _, reply = ReplayModel(RECORDED, "free").sample(PROMPT, n=2, seed=0)
    assert reply.usage == Usage(prompt_tokens=1, cost_usd=0.0)


def test_a_recording_that_ends_early_is_one_sentence():
    with pytest.raises(ModelError, match="holds 5 replies, but this run needs more"):
        texts(ReplayModel(RECORDED, "free"), 6)
