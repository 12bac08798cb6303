from dataclasses import replace
from random import Random

import pytest

from openeureka.config import RunConfig
from openeureka.strategies import Best, Eureka, Ranking, make, prompt_plan, sized
from openeureka.testing.conformance.search import entries, grown
from openeureka.types import History, Place, Remark, RemarkKind, VerdictCode


def shown(strategy, told: History) -> list[float | None]:
    (plan,) = strategy.ask(told, Random(0))
    return [turn.fitness for turn in plan.turns]


def test_a_history_grows_by_one_generation_and_the_given_one_is_left_alone() -> None:
    empty = History()
    one = empty.grown(entries(0, [1.0, None]))
    two = one.grown(entries(1, [2.0]))
    assert (len(empty.generations), len(one.generations), len(two.generations)) == (0, 1, 2)
    assert [generation.index for generation in two.generations] == [0, 1]
    assert two.generations[0] == one.generations[0]
    assert two.generations[1].entries == tuple(entries(1, [2.0]))


def test_eureka_shows_the_best_of_the_last_generation_even_if_worse() -> None:
    strategy = Eureka(samples=3)
    assert shown(strategy, grown([1.0, 5.0], [2.0, 3.0])) == [3.0]


def test_eureka_goes_back_to_the_last_generation_in_which_something_trained() -> None:
    strategy = Eureka(samples=3)
    assert shown(strategy, grown([1.0, 5.0], [2.0], [None, None])) == [2.0]


def test_best_shows_the_best_so_far_last_after_up_to_three_other_winners() -> None:
    strategy = Best(samples=3)
    assert shown(strategy, grown([5.0, 4.0])) == [5.0]
    assert shown(strategy, grown([1.0], [5.0], [2.0])) == [1.0, 2.0, 5.0]
    assert shown(strategy, grown([5.0], [1.0], [2.0], [3.0], [4.0])) == [2.0, 3.0, 4.0, 5.0]


def test_best_shows_a_program_that_won_twice_once() -> None:
    strategy = Best(samples=1)
    told = History().grown(entries(0, [5.0])).grown(entries(0, [5.0]))
    assert shown(strategy, told) == [5.0]


def test_negative_scores_win_as_others_do() -> None:
    for strategy in (Eureka(samples=1), Best(samples=1)):
        assert shown(strategy, grown([-3.0, -0.5, None])) == [-0.5]


def test_best_tells_the_model_what_counts_and_eureka_as_little_as_published() -> None:
    for strategy, informed in ((Best(samples=1), True), (Eureka(samples=1), False)):
        (first,) = strategy.ask(History(), Random(0))
        (later,) = strategy.ask(grown([5.0], [2.0]), Random(0))
        assert (first.informed, later.informed, first.best) == (informed, informed, None)
        assert (later.best.fitness if later.best else None) == (5.0 if informed else None)


def test_best_tells_of_the_other_rewards_of_the_parents_generation() -> None:
    strategy = Best(samples=1)
    (plan,) = strategy.ask(grown([5.0, 4.0, None], [2.0, 3.0]), Random(0))
    assert [entry.fitness for entry in plan.siblings] == [4.0, None]
    (plan,) = Eureka(samples=1).ask(grown([5.0, 4.0]), Random(0))
    assert plan.siblings == ()


def test_best_tells_nothing_of_rewards_that_a_person_rejected() -> None:
    vetoes = [Remark(kind=RemarkKind.VETO, place=Place(0, slot)) for slot in (0, 2)]
    (plan,) = Best(samples=1).ask(grown([5.0, 4.0, 6.0, 1.0]).heard(vetoes), Random(0))
    assert [turn.fitness for turn in plan.turns] == [4.0]
    assert [entry.fitness for entry in plan.siblings] == [1.0]


def test_a_favourite_is_told_of_where_it_is_the_parent() -> None:
    history = grown([5.0, 4.0]).heard([Remark(kind=RemarkKind.FAVOURITE, place=Place(0, 1))])
    ranking = Ranking(history)
    other, own = history.generations[0].entries
    conversations = ([other], [own], [own, other], [other, own], [])
    told = [prompt_plan(1, turns, history, ranking).opinion.chosen for turns in conversations]
    assert told == [False, True, False, True, False]
    for strategy in (Eureka(samples=1), Best(samples=1)):
        assert shown(strategy, history)[-1] == 4.0


def test_votes_for_and_against_the_parent_are_told() -> None:
    history = grown([5.0, 4.0]).heard([Remark(kind=RemarkKind.VOTE, place=Place(0, 1), over=Place(0, 0))])
    ranking = Ranking(history)
    told = [prompt_plan(1, turns, history, ranking).opinion for turns in (*([e] for e in history.entries), [])]
    assert [(opinion.won, opinion.lost) for opinion in told] == [(0, 1), (1, 0), (0, 0)]


def test_failures_are_told_only_of_a_last_generation_in_which_nothing_trained() -> None:
    for strategy in (Eureka(samples=1), Best(samples=1)):
        told = grown([1.0]).grown(entries(1, [0.0, 0.0], refused=True))
        (plan,) = strategy.ask(told, Random(0))
        assert [turn.fitness for turn in plan.turns] == [1.0]
        assert plan.failures == told.generations[-1].entries
        (plan,) = strategy.ask(told.grown(entries(2, [2.0])), Random(0))
        assert plan.failures == ()
    refused, other = entries(1, [0.0, 0.0], refused=True)
    screened = replace(other.sample, verdict=replace(other.sample.verdict, code=VerdictCode.SCREENED))
    (plan,) = Best(samples=1).ask(grown([1.0]).grown([refused, replace(other, sample=screened)]), Random(0))
    assert plan.failures == (refused,), "nothing is wrong with a reward that another was preferred to"


@pytest.mark.parametrize(("name", "kind", "ranks"), [("eureka", Eureka, "training"), ("best", Best, "played")])
def test_strategies_are_made_by_name(name, kind, ranks) -> None:
    strategy = make(RunConfig(search=name, sample=7))
    assert isinstance(strategy, kind)
    assert (strategy.samples, strategy.ranks) == (7, ranks)


def test_sizes_default_to_the_kind_of_model_and_can_be_set() -> None:
    free, small = sized(RunConfig(), "free"), sized(RunConfig(), "grammar")
    assert (free.sample, free.iteration) == (16, 5)
    assert small.sample < free.sample and small.iteration < free.iteration
    own = sized(RunConfig(sample=3), "free")
    assert (own.sample, own.iteration) == (3, 5)
