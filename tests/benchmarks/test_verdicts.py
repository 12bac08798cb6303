"""Races with drawn scores: how often the interval in use errs, and how often the alternatives to it do."""

import pytest
import verdicts
from scipy.stats import ttest_ind

from openeureka.method import race
from openeureka.stats import difference


def test_welchs_interval_is_scipys():
    own, other = [1.0, 2.0, 4.0], [0.1, 0.2, 0.4, 0.3]
    known = ttest_ind(own, other, equal_var=False).confidence_interval(0.95)
    found = verdicts.welch(own, other)
    assert (found.low, found.high) == pytest.approx((known.low, known.high))


def test_one_spread_for_all_is_narrow_where_the_rivals_are_calm():
    own, other, calm = [1.0, 2.0, 3.0], [0.9, 1.0, 1.1], [[1.5, 1.6, 1.7]] * 2
    before, now = verdicts.pooled(own, other, calm), difference(own, other, calm)
    assert now is not None and now.high - now.value > 1.2 * (before.high - before.value)
    alone, by_hand = verdicts.pooled(own, other), ttest_ind(own, other).confidence_interval(0.95)
    assert (alone.low, alone.high) == pytest.approx((by_hand.low, by_hand.high))


def test_races_are_decided_by_the_rule_that_is_asked(monkeypatch: pytest.MonkeyPatch):
    row = {"generated": [1.0, 3.0, 2.0], "runners_up": {"g0s1": [1.0, 1.1, 1.2]}, "human": [0.5, 0.7, 0.6, 0.6]}
    monkeypatch.setattr(verdicts, "read", lambda _: {"ant": row, "door": row | {"generated": [0.0, 1.0, 1.0]}})
    monkeypatch.setattr(verdicts, "SEEDS", (3,))
    usual = race.difference
    measured = verdicts.measure(races=60)
    assert race.difference is usual
    assert list(measured["rows"]) == ["ant", "door"]
    ours, before, own = verdicts.rows(measured)
    assert (ours[1], before[1], own[1]) == ("3", "3", "3")
    seeds = [float(row[-1]) for row in (before, ours, own)]
    assert seeds == sorted(seeds), "the narrower the interval, the sooner a race is over"
