from dataclasses import replace
from random import Random

from loop.alone import run

from openeureka.config import RunConfig
from openeureka.llm.client import LanguageModel
from openeureka.llm.replay import ReplayModel
from openeureka.method import prompts
from openeureka.store import Store, read_replies
from openeureka.strategies import make
from openeureka.strategies.islands import RENEWAL, Islands, islands
from openeureka.testing.conformance.search import SearchConformance, entries, grown
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, reply
from openeureka.types import Evaluation, History, Place, PromptPlan, Remark, RemarkKind


class TestIslands(SearchConformance):
    def make(self) -> Islands:
        return islands(RunConfig(sample=4))


SEARCH = "openeureka.strategies.islands:islands"
TWO = Islands(samples=4)
"""Two islands: slots 0 and 1, and slots 2 and 3."""


def parents(plans: list[PromptPlan]) -> list[Place]:
    return [plan.turns[-1].sample.place for plan in plans]


def asked(history: History, seed: int = 0) -> list[PromptPlan]:
    return [*TWO.ask(history, Random(seed))]


def test_it_is_found_by_its_name() -> None:
    assert isinstance(make(RunConfig(sample=8, search="openeureka.strategies.islands:islands")), Islands)


def test_slots_are_shared_out_evenly_whatever_their_number() -> None:
    assert [Islands(samples).count for samples in (1, 3, 4, 8, 16)] == [1, 1, 2, 4, 4]
    assert [plan.count for plan in Islands(10).ask(grown([1.0] * 10), Random(0))] == [3, 2, 3, 2]
    assert [TWO.island(slot, 4) for slot in range(4)] == [0, 0, 1, 1]
    assert [TWO.island(slot, 12) for slot in range(12)] == [0] * 6 + [1] * 6  # screen=3
    assert TWO.island(0, 1) == 0  # a given reward


def test_the_first_generation_is_asked_for_at_once() -> None:
    assert [plan.count for plan in asked(History())] == [4]


def test_each_island_improves_its_own_best() -> None:
    history = grown([1.0, 5.0, 2.0, 3.0], [4.0, 4.5, 2.5, None])
    plans = asked(history)
    assert parents(plans) == [Place(0, 1), Place(0, 3)]
    assert all(plan.informed and plan.best == plans[0].turns[-1] and not plan.siblings for plan in plans)


def test_some_prompts_combine_the_two_best_of_an_island_the_better_one_last() -> None:
    history = grown([1.0, 5.0, 2.0, 3.0], [4.0, 4.5, 2.5, None])
    plans = [plan for seed in range(40) for plan in asked(history, seed)]
    crossed = [plan for plan in plans if plan.crossover]
    assert 20 < len(crossed) < 60  # of 80, half are expected
    shown = {tuple(turn.sample.place for turn in plan.turns) for plan in crossed}
    assert shown == {(Place(1, 1), Place(0, 1)), (Place(1, 2), Place(0, 3))}
    assert all(len(plan.turns) == 1 for plan in plans if not plan.crossover)


def test_the_weakest_island_begins_anew_from_the_best_of_another() -> None:
    weak = [[5.0, 4.0, 1.0, 2.0]] * RENEWAL
    history = grown(*weak)
    renewed = asked(history)
    assert parents(renewed) == [Place(0, 0), Place(0, 0)]
    # From then on it only improves its new children, even if they are worse than its old rewards.
    later = history.grown(entries(RENEWAL, [0.0, 0.0, 0.5, 0.25]))
    assert parents(asked(later)) == [Place(0, 0), Place(RENEWAL, 2)]
    # That one of them is better than all does not make the other island the one that was weakest.
    grew = history.grown(entries(RENEWAL, [0.0, 0.0, 9.0, 0.25]))
    assert parents(asked(grew)) == [Place(0, 0), Place(RENEWAL, 2)]
    # If none of the children trained, the island begins anew once more.
    lost = history.grown(entries(RENEWAL, [0.0, 0.0, None, None]))
    assert parents(asked(lost)) == [Place(0, 0), Place(0, 0)]


def test_an_island_that_begins_anew_takes_from_any_other_and_a_single_one_never_does() -> None:
    four = Islands(samples=8)
    lost = grown([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, None, None])
    taken = {parents([*four.ask(lost, Random(seed))])[3] for seed in range(20)}
    assert taken == {Place(0, 1), Place(0, 3), Place(0, 5)}
    alone = grown(*[[5.0, 4.0, 1.0]] * RENEWAL, [0.5, 0.25, 0.0])
    assert parents([*Islands(samples=3).ask(alone, Random(0))]) == [Place(0, 0)]


def test_an_island_whose_policies_break_a_limit_is_the_weakest() -> None:
    history = grown(*[[5.0, 4.0, 9.0, 8.0]] * RENEWAL)
    played = {
        entry.result.lane: Evaluation(
            lane=entry.result.lane, fitness=entry.score, episode_length=1.0, episodes=8,
            costs={"torque": 99.0 if entry.sample.slot > 1 else 10.0},
        )
        for entry in history.entries if entry.result is not None
    }  # fmt: skip
    limited = replace(history.rescored(played), limits={"torque": 40.0})
    assert parents(asked(limited)) == [Place(0, 0), Place(0, 0)]
    later = limited.grown(entries(RENEWAL, [0.0, 0.0, 0.5, 0.25]))
    assert parents(asked(later)) == [Place(0, 0), Place(RENEWAL, 2)]


def test_where_votes_decide_they_say_which_island_is_the_weakest() -> None:
    history = replace(grown(*[[1.0, 0.5, 5.0, 4.0]] * RENEWAL), judge="votes")
    vote = Remark(kind=RemarkKind.VOTE, place=Place(RENEWAL - 1, 0), over=Place(RENEWAL - 1, 2))
    assert parents(asked(history.heard([vote]))) == [Place(RENEWAL - 1, 0)] * 2


def test_an_island_on_which_nothing_trained_takes_from_another() -> None:
    assert parents(asked(grown([1.0, 2.0, None, None]))) == [Place(0, 1), Place(0, 1)]


def test_a_favourite_is_the_parent_on_all_islands() -> None:
    history = grown([1.0, 5.0, 2.0, 3.0]).heard([Remark(kind=RemarkKind.FAVOURITE, place=Place(0, 2))])
    assert parents(asked(history)) == [Place(0, 2)] * 2
    assert not any(plan.crossover for seed in range(9) for plan in asked(history, seed)), "it takes two to combine"


def test_the_model_is_asked_to_combine_both() -> None:
    history = grown([1.0, 5.0, 2.0, 3.0])
    plan = next(plan for seed in range(40) for plan in asked(history, seed) if plan.crossover)
    prompt = prompts.render(TOY, plan, "free")
    assert [message.role for message in prompt.messages].count("assistant") == 2
    assert "The last two reward functions above are to be combined" in prompt.messages[-1].content
    text = "".join(message.content for message in prompt.messages)
    assert "the one to improve" not in text
    mutate = replace(plan, crossover=False, turns=plan.turns[-1:])
    assert "to be combined" not in prompts.render(TOY, mutate, "free").messages[-1].content


def test_a_search_of_several_prompts_and_a_refill_is_replayed_as_it_was(tmp_path):
    refused = "```python\ndef compute_reward(x):\n    return x\n```"
    first, second = [reply(worth) for worth in (1, 2, 3, 4)], [reply(worth) for worth in (5, 6, 7, 8)]

    def go(name: str, answering: LanguageModel, **settings: object) -> History:
        config = RunConfig(
            **{"sample": 4, "iteration": 2, "repair": 0, "refill": 1, "seeds": 2, "search": SEARCH, **settings}
        )
        with Store.open(tmp_path / name, config) as store:
            run(config, store, answering, ToyChecker(), ToyTrainer(), TOY, make(config))
        with Store.view(tmp_path / name) as store:
            return store.history()

    whole = go("whole", ScriptedModel([*first, refused, *second]))
    again = ReplayModel(read_replies(tmp_path / "whole"), "free")
    assert go("again", again, model=f"replay:{tmp_path / 'whole'}") == whole
