import dataclasses
import math

import pytest

from openeureka.score import Outcome, SeedScores, clipped, excess, gain, human_normalised, pooled, rank
from openeureka.types import Evaluation


@pytest.mark.parametrize(
    ("method", "human", "sparse", "score"),
    [
        (8.0, 6.0, 2.0, 1.5),  # (8 - 2) / |6 - 2|
        (1.0, 6.0, 2.0, -0.25),  # (1 - 2) / |6 - 2|
        (-0.1, -0.5, -0.3, 1.0),  # human worse than sparse: (-0.1 + 0.3) / |-0.5 + 0.3|
        (1.0, 2.0, 2.0, None),
        (None, 2.0, 1.0, None),
        (1.0, None, 1.0, None),
        (1.0, 2.0, None, None),
    ],
)
def test_human_normalised_score(method, human, sparse, score) -> None:
    assert human_normalised(method, human, sparse) == (score if score is None else pytest.approx(score))


def test_clipping_to_zero_and_three() -> None:
    assert [clipped(score) for score in (-0.5, 1.5, 4.0, None)] == [0.0, 1.5, 3.0, None]


def test_undefined_ranks_below_everything() -> None:
    assert sorted([2.0, None, -5.0], key=rank) == [None, -5.0, 2.0]
    assert rank(math.nan) == -math.inf


def test_a_look_in_which_f_was_undefined_takes_no_error_from_the_others() -> None:
    undefined = Evaluation(lane="a", fitness=None, episode_length=9.0, episodes=8)
    known = Evaluation(lane="a", fitness=0.5, error=0.06, episode_length=9.0, episodes=8)
    assert pooled([undefined, known]) == pooled([known, undefined]) == known
    assert pooled([undefined, undefined]) == dataclasses.replace(undefined, episodes=16)


def test_errors_of_looks_that_share_start_states_add_up() -> None:
    looks = [
        Evaluation(lane="a", fitness=f, episode_length=1.0, episodes=n, error=0.4) for f, n in ((1.0, 8), (3.0, 8))
    ]
    # Equal shares: half of sqrt(0.4^2 + 0.4^2) where they are independent, half of 0.4 + 0.4 where they are not.
    assert pooled(looks).error == pytest.approx(0.4 / math.sqrt(2))
    assert pooled(looks, shared=True).error == pytest.approx(0.4)
    assert pooled(looks, shared=True).fitness == pooled(looks).fitness == 2.0


def test_an_outcome_is_normalised_by_means_over_seeds() -> None:
    outcome = Outcome(
        best=None,
        method=SeedScores(held_out=(3.0, None)),
        human=SeedScores(held_out=(4.0, 4.0)),
        sparse=SeedScores(held_out=(2.0, 2.0)),
    )
    assert outcome.normalised == 0.5  # (3 - 2) / (4 - 2)


def test_looks_whose_episodes_were_lost_weigh_nothing() -> None:
    none = Evaluation(lane="a", fitness=None, episode_length=3.0, episodes=0, lost=8)
    some = Evaluation(lane="a", fitness=2.0, episode_length=6.0, episodes=4, lost=4)
    assert pooled([none, none]) == dataclasses.replace(none, lost=16)
    assert pooled([none, some]) == dataclasses.replace(some, lost=12)


def test_the_excess_is_a_sum_of_shares_of_the_limits_that_are_broken() -> None:
    costs = {"torque": 45.0, "power": 30.0, "falls": 0.25, "tilt": 1.0}
    score = Evaluation(lane="a", fitness=1.0, episode_length=1.0, episodes=8, costs=costs)
    # 5 / 40 + 10 / 20; a limit of zero has no shares.
    assert excess(score, {"torque": 40.0, "power": 20.0, "tilt": 2.0}) == pytest.approx(0.625)
    assert excess(score, {"falls": 0.0}) == pytest.approx(0.25)


def test_the_gain_of_one_policy_over_another_by_hand() -> None:
    own = Evaluation(lane="a", fitness=5.0, error=0.3, episode_length=1.0, episodes=8)
    other = Evaluation(lane="b", fitness=3.0, error=0.4, episode_length=1.0, episodes=6)
    # Errors of 0.3 and 0.4 are 0.5 together: half = 1.96 * 0.5.
    found = gain(own, other)
    assert found is not None and found.sure and found.count == 6
    assert (found.value, found.low, found.high) == pytest.approx((2.0, 1.02, 2.98), abs=1e-3)
    unknown = dataclasses.replace(other, error=None)
    for pair in ((own, unknown), (unknown, own)):
        found = gain(*pair)
        assert found is not None and found.low is None and not found.sure
    assert gain(own, dataclasses.replace(other, fitness=None)) is None


@pytest.mark.parametrize(
    ("method", "human", "word"),
    [
        ((5.0, 5.1), (1.0, 1.1), "better"),
        ((1.0, 1.1), (5.0, 5.1), "worse"),
        ((1.0, 9.0), (2.0, 7.0), "not decided"),
        ((5.0, 5.0), (5.0, 5.0), "no difference"),
        ((0.0, 0.1), (0.1, 0.0), "nothing learnt"),  # untrained policies score as much
        ((5.0, 5.1), (None, None), ""),
        ((None, None), (5.0, 5.1), ""),
        ((5.0,), (1.0, 1.1), "not decided"),  # one seed
    ],
)
def test_the_verdict_in_a_word(method, human, word) -> None:
    untrained = (0.0, 0.1, 0.05) if word in ("nothing learnt", "no difference") else ()
    found = Outcome(
        best=None, method=SeedScores(held_out=method), human=SeedScores(held_out=human), untrained=untrained
    )
    assert found.word == word
