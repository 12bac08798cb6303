import math

import pytest

from openeureka.strategies import Ranking
from openeureka.strategies.ranking import PRIOR, strengths
from openeureka.testing.conformance.search import entries
from openeureka.types import History, Place, Remark, RemarkKind


def vote(better: Place, worse: Place) -> Remark:
    return Remark(kind=RemarkKind.VOTE, place=better, over=worse)


def veto(place: Place) -> Remark:
    return Remark(kind=RemarkKind.VETO, place=place)


def first(ranking: Ranking) -> Place | None:
    return ranking.best.sample.place if ranking.best is not None else None


def test_two_items_solve_the_equations_by_hand() -> None:
    # a beat b three times of four. By symmetry b = 1 / a, and the derivative of the log-posterior in log a is
    # (3 + p) - 4 a / (a + b) - 2 p a / (a + 1) = 0 with p the prior.
    found = strengths([("a", "b")] * 3 + [("b", "a")])
    a, b = found["a"], found["b"]
    assert a * b == pytest.approx(1.0, rel=1e-6)
    assert (3 + PRIOR) - 4 * a / (a + b) - 2 * PRIOR * a / (a + 1) == pytest.approx(0.0, abs=1e-6)
    # Without a prior the odds would be 3 to 1, that is a = sqrt(3); the prior pulls a little towards 1.
    assert 1.0 < a < math.sqrt(3)
    assert a == pytest.approx(math.sqrt(3), rel=0.1)


def test_preferences_are_transitive_and_nobody_is_infinitely_strong() -> None:
    found = strengths([("a", "b"), ("b", "c")])
    assert found["a"] > found["b"] > found["c"] > 0
    assert found["b"] == pytest.approx(1.0)
    assert math.isfinite(found["a"])


def test_without_votes_nobody_has_a_strength() -> None:
    assert strengths([]) == {}


def test_judged_by_votes_the_preferred_candidate_is_ahead_of_one_with_higher_f() -> None:
    history = History(judge="votes").grown(entries(0, [5.0, 1.0, 9.0]))
    assert first(Ranking(history)) == Place(0, 2)  # nobody voted yet: F decides
    heard = history.heard([vote(Place(0, 1), Place(0, 0))])
    assert first(Ranking(heard)) == Place(0, 1)  # g0s2, which nobody compared, is below g0s0 too: see the next line
    assert first(Ranking(heard.heard([*heard.generations[0].remarks, veto(Place(0, 1))]))) == Place(0, 0)


def test_votes_do_not_outrank_f_where_f_judges() -> None:
    history = History().grown(entries(0, [5.0, 1.0])).heard([vote(Place(0, 1), Place(0, 0))])
    assert first(Ranking(history)) == Place(0, 0)


def test_a_favourite_wins_against_its_whole_generation_and_is_the_next_parent() -> None:
    history = History(judge="votes").grown(entries(0, [5.0, 1.0, 9.0]))
    ranking = Ranking(history.heard([Remark(kind=RemarkKind.FAVOURITE, place=Place(0, 1))]))
    assert first(ranking) == Place(0, 1)
    assert ranking.favourite == history.generations[0].entries[1]
    assert ranking.record(history.generations[0].entries[1].candidate_id) == (2, 0)


def test_a_vetoed_favourite_is_no_parent_and_a_favourite_counts_for_one_generation() -> None:
    liked = Remark(kind=RemarkKind.FAVOURITE, place=Place(0, 1))
    history = History().grown(entries(0, [5.0, 1.0]))
    assert Ranking(history.heard([liked, veto(Place(0, 1))])).favourite is None
    assert Ranking(history.heard([liked]).grown(entries(1, [2.0]))).favourite is None


def test_when_all_are_vetoed_there_is_no_best() -> None:
    history = History().grown(entries(0, [5.0])).heard([veto(Place(0, 0))])
    assert Ranking(history).best is None
    assert Ranking(history).winners == ()
