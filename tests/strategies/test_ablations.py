from dataclasses import replace
from random import Random

from openeureka.config import RunConfig
from openeureka.strategies import Best
from openeureka.strategies.ablations import unreflected
from openeureka.testing.conformance.search import entries
from openeureka.types import History


def test_without_reflection_the_model_hears_scores_and_nothing_of_components() -> None:
    strategy = unreflected(RunConfig(sample=2))
    told = [replace(entry, feedback="upright: [0.1, 0.9]") for entry in entries(0, [1.0, 5.0])]
    history = History().grown(told)
    (plan,), (whole,) = strategy.ask(history, Random(0)), Best(2).ask(history, Random(0))
    assert [turn.feedback for turn in plan.turns] == ["task_score, at best in training: 5.00"]
    assert whole.siblings and not plan.siblings
    assert replace(plan, turns=whole.turns, siblings=whole.siblings) == whole  # all else is as in `best`
