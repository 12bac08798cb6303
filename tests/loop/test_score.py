import math

import pytest

from openeureka.score import Arm, Outcome, clipped, human_normalised, mean, pearson, rank


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


def test_mean_leaves_undefined_values_out() -> None:
    assert mean([1.0, None, math.nan, 4.0]) == 2.5
    assert mean([None]) is None


def test_undefined_ranks_below_everything() -> None:
    assert sorted([2.0, None, -5.0], key=rank) == [None, -5.0, 2.0]
    assert rank(math.nan) == -math.inf


def test_pearson_by_hand() -> None:
    # means 2 and 3; deviations (-1, 0, 1) and (-2, 1, 1): 3 / sqrt(2 * 6)
    assert pearson([1, 2, 3], [1, 4, 4]) == pytest.approx(3 / math.sqrt(12))
    assert pearson([1, 2, 3], [3, 2, 1]) == pytest.approx(-1)


def test_pearson_uses_the_pairs_in_which_both_are_defined() -> None:
    assert pearson([1, None, 2, 3], [1, 9, 4, 4]) == pytest.approx(3 / math.sqrt(12))
    assert pearson([1, math.nan, 2, 3], [1, 9, 4, 4]) == pytest.approx(3 / math.sqrt(12))


def test_pearson_is_undefined_for_constants_and_single_pairs() -> None:
    assert pearson([1, 1, 1], [1, 2, 3]) is None
    assert pearson([1], [2]) is None
    assert pearson([], []) is None


def test_an_outcome_is_normalised_by_means_over_seeds() -> None:
    outcome = Outcome(
        best=None,
        method=Arm(training=(7.0, 9.0), held_out=(3.0, None)),
        human=Arm(training=(6.0, 6.0), held_out=(4.0, 4.0)),
        sparse=Arm(training=(1.0, 3.0), held_out=(2.0, 2.0)),
    )
    assert outcome.normalised_training == 1.5  # (8 - 2) / (6 - 2)
    assert outcome.normalised == 0.5  # (3 - 2) / (4 - 2)
