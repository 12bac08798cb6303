import math
from itertools import product
from random import Random

import pytest

from openeureka.stats import (
    Difference,
    Estimate,
    difference,
    estimate,
    jackknife,
    mean,
    midranks,
    pearson,
    spent,
    two_valued,
)


def test_mean_leaves_undefined_values_out() -> None:
    assert mean([1.0, None, math.nan, 4.0]) == 2.5
    assert mean([None]) is None


def test_pearson_by_hand() -> None:
    # means 2 and 3; deviations (-1, 0, 1) and (-2, 1, 1): 3 / sqrt(2 * 6)
    assert pearson([1, 2, 3], [1, 4, 4]) == pytest.approx(3 / math.sqrt(12))
    assert pearson([1, 2, 3], [3, 2, 1]) == pytest.approx(-1)
    assert pearson([1e6 + 1, 1e6 + 2, 1e6 + 3], [1, 4, 4]) == pytest.approx(3 / math.sqrt(12))  # that is no rounding


def test_pearson_uses_the_pairs_in_which_both_are_defined() -> None:
    assert pearson([1, None, 2, 3], [1, 9, 4, 4]) == pytest.approx(3 / math.sqrt(12))
    assert pearson([1, math.nan, 2, 3], [1, 9, 4, 4]) == pytest.approx(3 / math.sqrt(12))


def test_pearson_is_undefined_for_constants_and_single_pairs() -> None:
    assert pearson([1, 1, 1], [1, 2, 3]) is None
    assert pearson([0.1] * 3, [0, 1, 2]) is None and pearson([0, 1, 2], [0.7] * 3) is None  # their means are rounded
    assert pearson([0, 0, 0], [0, 1, 2]) is None and pearson([0, 1, 2], [0, 0, 0]) is None
    assert pearson([1], [2]) is None
    assert pearson([], []) is None


def test_equal_values_share_the_mean_of_their_ranks() -> None:
    # In order -inf -inf 0.5 3 3 3: places 1 and 2, 3, 4 to 6.
    assert midranks([3.0, -math.inf, 3.0, 0.5, -math.inf, 3.0]).tolist() == [5.0, 1.5, 5.0, 3.0, 1.5, 5.0]


def test_the_jackknife_of_a_mean_is_its_standard_error() -> None:
    # The mean of 1, 2 and 3 without each: 2.5, 2 and 1.5. Its standard error is 1 / sqrt(3).
    assert jackknife([2.5, 2.0, 1.5]) == pytest.approx(1 / math.sqrt(3))


def test_the_interval_of_a_difference_by_hand() -> None:
    # Means 10 and 4; squares 2 + 2 + 0.5 + 0.5 over 2 + 1 degrees of freedom: spread sqrt(5 / 3) = 1.291.
    # t(3) at 97.5 % is 3.182: half = 3.182 * 1.291 * sqrt(1/3 + 1/2) = 3.750.
    found = difference([10.0, 8.586, 11.414], [4.707, 3.293])
    assert found is not None
    assert (found.value, found.low, found.high) == pytest.approx((6.0, 2.250, 9.750), abs=2e-3)
    assert found.sure


def test_the_best_of_several_needs_a_wider_interval() -> None:
    groups = [[10.0, 11.0], [4.0, 5.0], [9.0, 8.0]]
    one, both = (difference(groups[0], groups[1], groups[2:], claims=claims) for claims in (1, 2))
    assert one is not None and both is not None
    # The wider interval is that of the two alone, with t(2) = 4.303 at 97.5 % and 6.205 at 98.75 %. The pool of all
    # three has t(3) = 3.182 and 4.177.
    assert (both.high - both.value) / (one.high - one.value) == pytest.approx(6.205 / 4.303, abs=1e-3)


def test_a_noisy_reward_does_not_look_steady_beside_calm_ones() -> None:
    own, other, calm = [1.0, 2.0, 3.0], [0.9, 1.0, 1.1], [[1.5, 1.6, 1.7]] * 2
    alone, beside = difference(own, other), difference(own, other, calm)
    assert alone is not None and beside is not None
    assert alone.high - alone.value == pytest.approx(2.776 * math.sqrt(1 / 3 + 0.01 / 3), abs=1e-3)
    assert (beside.low, beside.high) == (alone.low, alone.high)
    # Two calm rewards, two noisy rivals: the pooled variance is (0.02 * 2 + 2 * 2) / 8 = 0.505, and t(8) = 2.306.
    calm_too = difference(calm[0], other, [own, own])
    assert calm_too is not None
    assert calm_too.high - calm_too.value == pytest.approx(2.306 * math.sqrt(0.505 * 2 / 3), abs=1e-3)


def test_seeds_that_do_not_differ_decide_as_soon_as_so_many_are_no_chance() -> None:
    def apart(own: int, other: int, claims: float = 1) -> Difference:
        found = difference([1.0] * own, [0.0] * other, claims=claims)
        assert found is not None and found.value == 1.0 and found.low >= 0.0
        return found

    # Fisher's exact test: 2 / C(6, 3) = 0.1, 1 / C(7, 3) = 0.029, 2 / C(8, 4) = 0.029.
    assert [apart(2, 2).sure, apart(3, 3).sure, apart(3, 4).sure, apart(4, 4).sure] == [False, False, True, True]
    assert not apart(4, 4, claims=2).sure
    assert apart(2, 2).seeds == 4
    assert (apart(3, 3).low, apart(3, 3).high) == (0.0, 2.0)
    assert difference([0.1] * 3, [0.3] * 3).low < -0.3  # type: ignore[union-attr]
    # Paired: 2 / 2^5 = 0.0625, 2 / 2^6 = 0.031.
    five, six = (estimate([0.2] * count) for count in (5, 6))
    assert five is not None and six is not None and (five.sure, six.sure) == (False, True)
    # Three values that differ by rounding alone have no spread and are too few. Of 9 intervals: 9 * 2 / 2^6 = 0.28.
    thirds, nine = estimate([1 / 3, 2 / 3 - 1 / 3, 1 - 2 / 3]), estimate([1.0] * 6, claims=9)
    assert thirds is not None and nine is not None and not thirds.sure and not nine.sure


def test_the_interval_of_a_mean_by_hand() -> None:
    # Spreads are 1 and sqrt(2). t(2) = 4.3027: half = 4.3027 / sqrt(3) = 2.4841. t(1) = 12.7062: half = 12.7062.
    three, two = estimate([1.0, None, 2.0, 3.0]), estimate([1.0, 3.0])
    assert three is not None and two is not None and (three.count, two.count) == (3, 2)
    assert (three.value, three.low, three.high) == pytest.approx((2.0, -0.4841, 4.4841), abs=1e-4)
    assert (two.value, two.low, two.high) == pytest.approx((2.0, -10.7062, 14.7062), abs=1e-4)
    # Two intervals that hold together have 97.5 % each: t(2) = 6.2053, half = 3.5827.
    both = estimate([1.0, 2.0, 3.0], claims=2)
    assert both is not None and both.low == pytest.approx(2 - 3.5827, abs=1e-4)
    higher = estimate([4.0, 5.0, 6.0])
    assert higher is not None and higher.sure and not three.sure
    assert estimate([5.0, None]) == Estimate(value=5.0, low=None, high=None, count=1) and estimate([None]) is None
    assert not Estimate(value=5.0, low=None, high=None, count=1).sure
    touching = [Estimate(value=low + 1, low=low, high=low + 2, count=3) for low in (-2.0, 0.0)]
    assert not any(found.sure for found in touching), "an interval that ends at zero leaves a doubt"


def test_one_seed_of_each_has_no_interval() -> None:
    assert difference([1.0], [2.0]) is None
    assert difference([], [2.0, 3.0]) is None
    assert difference([9.0], [2.0, 2.1, 1.9]) is None  # its other seeds may have diverged


def test_the_looks_of_a_race_share_its_errors() -> None:
    assert [spent(trained, 6, 2) for trained in (2, 3, 4, 5, 6)] == pytest.approx([0.025] * 4 + [0.9])
    assert spent(2, 2, 2) == spent(1, 1, 2) == 1.0


def test_how_many_seeds_would_decide() -> None:
    found = difference([10.0, 8.0, 12.0], [9.0, 7.0, 11.0])  # a difference of 1 in a spread of 2
    # n with t(2 n - 2) * 2 * sqrt(2 / n) < 1: 32 gives 0.9996 (t(62) = 1.9990), 31 gives 1.016.
    assert found is not None and not found.sure and found.seeds == 32
    assert difference([1.0, 2.0], [1.0, 2.0]).seeds is None  # type: ignore[union-attr]
    # t(198) * sqrt(2 / 100) = 0.2789 is the least that 100 seeds decide in a spread of 1: no more are counted.
    assert [apart.seeds for apart in (_in_spread_of_one(0.279), _in_spread_of_one(0.278))] == [100, None]
    # t(4) * sqrt(2 / 3) = 2.27 and t(2) * sqrt(2 / 2) = 4.30
    assert [apart.seeds for apart in (_in_spread_of_one(4.2), _in_spread_of_one(4.4))] == [3, 2]


def _in_spread_of_one(value: float) -> Difference:
    found = difference([value - 1, value, value + 1], [-1.0, 0.0, 1.0])
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(3))
def test_intervals_hold_as_often_as_they_say(seed: int) -> None:
    """If all rewards are equally good, the interval holds zero in 95 of 100 races, here of four rewards with three
    seeds each."""
    random = Random(seed)
    missed = 0
    for _ in range(1000):
        groups = [[random.gauss(0, 1) for _ in range(3)] for _ in range(4)]
        best = max(range(3), key=lambda group: mean(groups[group]))
        rivals = [groups[group] for group in range(3) if group != best]
        found = difference(groups[best], groups[3], rivals, claims=3)
        missed += found is not None and found.sure and found.value > 0
    assert missed < 50  # 25 of 1000 above zero if none were picked; Bonferroni keeps the best of three below that


@pytest.mark.parametrize("seed", range(3))
def test_intervals_hold_beside_a_reward_that_never_differs(seed: int) -> None:
    """For example, a human reward scores 0 with every seed. Of 1000 intervals 50 miss, give or take 7."""
    random = Random(seed)
    missed = 0
    for _ in range(1000):
        found = difference([random.gauss(0.3, 0.1) for _ in range(3)], [0.0] * 4)
        assert found is not None
        missed += not found.low < 0.3 < found.high
    assert 30 < missed < 70


@pytest.mark.parametrize("rate", [0.5, 0.6, 0.7, 0.8, 0.9])
@pytest.mark.parametrize("never", [0, 1, 2])
def test_intervals_of_successes_hold_as_often_as_they_say(rate: float, never: int) -> None:
    """Some rewards succeed as often as the human one, the others never. Weighed by binomial probabilities, the best one
    is called better in at most 2.5 of 100 races, and worse in at most 2.5."""
    able, missed = 3 - never, {True: 0.0, False: 0.0}
    groups = [[1.0] * k + [0.0] * (3 - k) for k in range(4)]
    for counts in product(range(4), repeat=able):
        best = groups[max(counts)]
        rivals = [groups[k] for k in sorted(counts)[:-1]] + [groups[0]] * never
        for human in range(5):
            chance = math.prod(_binomial(3, k, rate) for k in counts) * _binomial(4, human, rate)
            found = difference(best, [1.0] * human + [0.0] * (4 - human), rivals, claims=3 / 0.9)
            assert found is not None
            if found.sure:
                missed[found.value > 0] += chance
    assert max(missed.values()) < 0.025


def test_trainings_that_succeed_or_do_not_are_counted_as_such() -> None:
    """By chance a training succeeds and scores about 0.95, or fails and scores about 0.03. The small spread about
    either value does not measure that chance."""
    two, four = (difference([0.99, 0.95, 1.0, 0.98][:n], [0.02, 0.0, 0.01, 0.04][:n]) for n in (2, 4))
    assert two is not None and four is not None
    assert (two.sure, four.sure) == (False, True)  # Fisher: 1 / 3, and 2 / 70
    assert two.low == pytest.approx(0.0) and two.value == pytest.approx(0.96)
    alike, partial, large = ([0.99, 0.95], [0.9, 0.8]), ([0.99, 0.98], [0.5, 0.51]), ([2.0, 2.01], [0.0, 0.01])
    for own, other in (partial, large):
        found = difference(own, other)
        assert found is not None and found.sure, "values that are not successes and failures are judged by their spread"
    assert difference(*alike) is not None
    assert two_valued([0.0, 0.9, 1.0]) and two_valued([0.5, 1.0, 1.0]) and not two_valued([0.8, 0.9, 1.0])


def _binomial(seeds: int, successes: int, rate: float) -> float:
    return math.comb(seeds, successes) * rate**successes * (1 - rate) ** (seeds - successes)


def test_more_successes_are_no_weaker_evidence() -> None:
    """Rivals that succeed with every seed say nothing about the spread of the others."""
    always = [[1.0] * 3]
    none, one = (difference([1.0] * 3, [1.0] * k + [0.0] * (4 - k), always) for k in (0, 1))
    assert none is not None and one is not None
    assert none.sure and not one.sure  # Fisher: 1 / 35 = 0.029, and 4 / 35 = 0.114
    assert difference([1.0] * 3, [1.0, 0.0, 0.0, 0.0], always) == difference([1.0] * 3, [1.0, 0.0, 0.0, 0.0])


def test_fishers_test_of_counts_by_hand() -> None:
    """9 of 9 against 3 of 9: of C(18, 12) = 18564 ways, C(9, 3) = 84 put all six failures in one group. Two-sided, that
    is doubled."""
    nine, three = [1.0] * 9, [1.0] * 3 + [0.0] * 6
    found, fourth = difference(three, nine), difference(three, nine, claims=6)
    assert found is not None and fourth is not None
    assert found.sure and not fourth.sure  # 6 * 0.00905 = 0.054
