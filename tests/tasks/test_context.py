"""What a language model is told of the tasks, beside what `TaskConformance` checks of any task."""

import pytest

from openeureka.tasks.context import context
from openeureka.tasks.registry import _BUILT_IN, get


@pytest.mark.parametrize("env", _BUILT_IN)
def test_every_task_says_what_its_score_is(env):
    known = context(env)
    low, high = known.score_range
    assert known.score_unit and len(known.score_unit) < 50
    assert low is None or high is None or low < high


def test_a_changed_task_claims_no_bounds_of_its_score():
    assert get("cartpole").score_range == (0.0, 499.0)
    assert get("cartpole+episode_length=100").score_range == (None, None)
