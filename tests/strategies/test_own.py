"""A user's search that asks for more samples than the settings say."""

from pathlib import Path
from random import Random

import pytest
from loop.alone import run

from openeureka import strategies
from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.store import Store
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, reply
from openeureka.types import History, PromptPlan


class Greedy(strategies.Best):
    def ask(self, history: History, rng: Random) -> list[PromptPlan]:
        return [PromptPlan(count=self.samples), PromptPlan(count=1)]


def test_more_samples_than_the_settings_say_are_refused_before_any_is_paid_for(tmp_path: Path) -> None:
    config = RunConfig(env="toy", sample=2, iteration=1, refill=0, seeds=1)
    model = ScriptedModel([reply(1)] * 3)
    said = r"`ask` of Greedy asks for 3 samples, but sample=2\."
    with Store.open(tmp_path, config) as store, pytest.raises(ConfigError, match=said):
        run(config, store, model, ToyChecker(), ToyTrainer(), TOY, Greedy(config.sample))
    assert model.prompts == []
