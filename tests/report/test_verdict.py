"""The sentence that opens every account of a search."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from openeureka.cli.show import summary
from openeureka.method import hacking
from openeureka.numbers import number
from openeureka.report import html
from openeureka.report.next_steps import commands
from openeureka.report.tables import measures, on_scale
from openeureka.report.verdict import lead, meaning, verdict
from openeureka.report.view import RunView
from openeureka.score import Outcome, SeedScores
from openeureka.store import Store
from openeureka.strategies import Ranking
from openeureka.testing.scripted import ToyTrainer, reply
from openeureka.types import Candidate, Evaluation, Generation, History, Place, Remark, RemarkKind

from .page import words
from .scripted import search_in
from .search import BASELINES, BEST, HISTORY, finished, refused, result, run

AGAIN = "eureka train env=cartpole reward=human,DIR/best/reward.py"


def ended(generated: Sequence[float | None], human: Sequence[float | None]) -> RunView:
    """HISTORY with these held-out scores of fresh seeds."""
    best = Candidate.of(BEST).id
    scores: dict[str, float | None] = {f"{best}-s{seed}": value for seed, value in enumerate(generated, start=1)}
    scores |= {f"human-s{seed}": value for seed, value in enumerate(human, start=1)}
    lanes = [result(lane, value) for lane, value in scores.items()] + [result(f"sparse-s{s}", 0.0) for s in (1, 2)]
    held_out = [Evaluation(lane=lane, fitness=value, episode_length=9.0, episodes=4) for lane, value in scores.items()]
    whole = run(HISTORY, [*BASELINES, *lanes], held_out)
    config, best = replace(whole.config, seeds=max(len(generated), len(human))), HISTORY.generations[2].entries[0]
    return replace(whole, config=config, crown=best.sample.place)


def test_an_environment_whose_every_episode_breaks_is_no_question_of_rewards():
    view = ended([None], [None])
    lost = {name: replace(score, episodes=0, lost=4) for name, score in view.evaluations.items()}
    assert verdict(replace(view, evaluations=lost, played={})).startswith(
        "No policy has a score: every episode that was played ended because a reward, an observation or the physics was"
    )
    (name, *_) = lost
    one = replace(lost[name], episodes=1)
    assert "was not finite" not in verdict(replace(view, evaluations={**lost, name: one}, played={}))


@pytest.mark.parametrize(
    ("generated", "human", "says"),
    [
        # Means 50 and 40, spread sqrt((2 + 2) / 2) = 1.41, t(2) = 4.303: half 6.09.
        (
            [49.0, 51.0],
            [39.0, 41.0],
            "The generated reward is better than the human one: F 50 (2 seeds) against 40",
        ),
        ([39.0, 41.0], [49.0, 51.0], "The generated reward is worse than the human one: F 40 (2 seeds) against 50"),
        # Means 41 and 40 in the same spread.
        (
            [40.0, 42.0],
            [39.0, 41.0],
            "Not decided: F 41 (2 seeds) against 40 (2 seeds), held out; difference +1",
        ),
        ([41.0], [40.0], "Not decided: F 41 (1 seed) against 40 (1 seed), held out. One seed says nothing about"),
        (
            [71.0, None, None],
            [40.0, 41.0, 42.0],
            "Not decided: F 71 (1 seed, 2 more without a score) against 41 (3 seeds), held out. One seed says nothing",
        ),
        ([41.0], [], "The generated reward reaches F 41 (1 seed), held out; there is no human reward to compare with."),
        ([1.0, 1.0], [1.0, 1.0, 1.0], "No difference: both rewards reach F 1 with every seed, held out."),
        ([1.0, None, 1.0], [1.0, 1.0], "Not decided: F 1 (2 seeds, 1 more without a score) against 1 (2 seeds)"),
        ([1.0, 1.0], [None, None], "The generated reward reaches F 1 (2 seeds), held out; no final training of the"),
        ([], [40.0, 41.0], "The generated reward lost: none of its final trainings left a policy"),
    ],
)
def test_the_verdict_follows_from_the_interval(
    generated: list[float | None], human: list[float | None], says: str
) -> None:
    assert verdict(ended(generated, human)).startswith(says)


def test_an_open_verdict_says_how_many_seeds_would_close_it() -> None:
    # n with t(2 n - 2) * 1.414 * sqrt(2 / n) < 1: 18 gives 0.958 (t(34) = 2.032), 17 gives 0.988, 16 gives 1.021.
    assert verdict(ended([40.0, 42.0], [39.0, 41.0])).endswith(
        "If the difference is real, 17 new seeds of each have an even chance to show it."
    )
    assert "more than 100 seeds" in verdict(ended([40.01, 42.0], [39.0, 43.0]))


@pytest.mark.parametrize(
    ("generated", "human", "first"),
    [
        ([40.0, 42.0], [39.0, 41.0], f"{AGAIN} seed=3 seeds=17"),
        ([41.0], [40.0], f"{AGAIN} seed=2 seeds=3"),
        ([49.0, 51.0], [39.0, 41.0], "eureka play DIR"),
        ([40.01, 42.0], [39.0, 43.0], "eureka play DIR"),  # it would take more than 100 seeds
    ],
)
def test_what_to_type_next_names_the_seeds_that_would_decide(
    generated: list[float], human: list[float], first: str
) -> None:
    typed = [command for command, _ in commands(ended(generated, human))]
    assert typed[0] == first and typed[-1] == "eureka play DIR"
    assert commands(ended(generated, human), "the run")[-1][0] == "eureka play 'the run'"


def test_a_chance_to_decide_is_told_where_two_seeds_say_how_far_seeds_differ() -> None:
    assert commands(ended([40.0, 42.0], [39.0, 41.0]))[0][1] == "an even chance to decide it"
    assert commands(ended([41.0], [40.0]))[0][1] == "train both with more seeds"


@pytest.mark.parametrize(
    ("generated", "human", "untrained", "learnt"),
    [
        ([40.0, 42.0, 41.0], [39.0, 41.0, 40.0], [40.5, 41.5], False),
        ([40.0, 42.0, 41.0], [39.0, 41.0, 40.0], [4.0, 5.0], True),
        ([0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0], False),
        ([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.0, 0.0, 0.0], False),  # by Fisher, 3 of 3 and 0 of 3 may be chance
        ([1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [0.0] * 6, True),
        ([40.0, 42.0, 41.0], [39.0, 41.0, 40.0], [40.0], True),  # an older version played one, which has no spread
    ],
)
def test_a_tie_of_policies_that_are_no_better_than_untrained_ones_asks_for_longer_trainings(
    generated: list[float], human: list[float], untrained: list[float], learnt: bool
) -> None:
    view = ended(generated, human)
    beginners = {
        name: Evaluation(lane="", fitness=value, episode_length=9.0, episodes=4)
        for name, value in zip(hacking.BEGINNERS, untrained, strict=False)
    }
    view = replace(view, tryouts={f"{Candidate.of(BEST).id}-s1": beginners})
    assert view.outcome is not None and (view.outcome.word != "nothing learnt") is learnt
    assert (
        verdict(view).startswith("Nothing learnt: policies of neither reward are shown to beat untrained ones; F ")
        is not learnt
    )
    longer = replace(view, config=replace(view.config, steps=1000))
    told = (f"{AGAIN} steps=3000 seed=4 seeds=3", "train both for longer")
    assert (commands(longer)[0] == told) is not learnt


def test_a_difference_that_is_sure_stays_one_where_both_learn_nothing() -> None:
    view = ended([39.0, 41.0], [49.0, 51.0])
    beginner = Evaluation(lane="", fitness=60.0, episode_length=9.0, episodes=4)
    view = replace(view, tryouts={f"{Candidate.of(BEST).id}-s1": dict.fromkeys(hacking.BEGINNERS, beginner)})
    assert verdict(view).startswith("The generated reward is worse than the human one")


def test_where_the_human_reward_was_measured_with_one_seed_training_it_along_decides() -> None:
    view = ended([41.0, 42.0], [40.0])
    known = replace(view, config=replace(view.config, env="humanoid", baselines="known"))
    assert verdict(known).endswith("The human one was measured with one seed; baselines=train uses as many.")
    often = replace(ended([71.0], []), config=replace(view.config, env="cartpole", baselines="known"))  # with three
    assert verdict(ended([71.0, None, None], [40.0, 41.0])).endswith("One seed says nothing about the next.")
    assert "One seed says nothing about the next" in verdict(often) and "was measured" not in verdict(often)


def test_the_best_of_more_given_rewards_has_to_win_more_clearly() -> None:
    # Two seeds of variance 2 each: a standard error of sqrt(2). t(2) is 4.303 for one claim, and 6.205 for two.
    rewards = {name: SeedScores(held_out=(mean - 1, mean + 1)) for name, mean in (("a", 20.0), ("b", 13.0))}
    alone, picked = lead(rewards, "a", "b"), lead({**rewards, "c": SeedScores(held_out=(1.0, 3.0))}, "a", "b")
    assert alone is not None and (alone.value, alone.low) == (7.0, pytest.approx(0.915, abs=1e-3))
    assert picked is not None and (picked.value, picked.low) == (7.0, pytest.approx(-1.775, abs=1e-3))


def test_where_fresh_trainings_alone_break_a_limit_the_verdict_says_so(tmp_path: Path) -> None:
    class Costly(ToyTrainer):
        def evaluate(self, *args: Any, **options: Any) -> Iterator[Evaluation]:
            for score in super().evaluate(*args, **options):
                yield replace(score, costs={"torque": 5.0 if "-s0" in score.lane else 50.0})

    view = RunView.read(search_in(tmp_path, [reply(7), reply(8)], trainer=Costly(), limits="torque=10"))
    assert verdict(view) == "No reward won: trained again with fresh seeds, each of the best breaks a limit."


def test_a_search_that_stops_before_its_final_trainings_are_judged_has_not_lost(tmp_path: Path) -> None:
    class Stops(ToyTrainer):
        def evaluate(self, *_: object, **__: object) -> Iterator[Evaluation]:
            raise KeyboardInterrupt
            yield

    with pytest.raises(KeyboardInterrupt):
        search_in(tmp_path, [reply(7), reply(8)], trainer=Stops(), search="eureka")
    view = RunView.read(tmp_path)
    assert verdict(view).startswith("Not decided yet")
    assert [command for command, _ in commands(view)] == ["eureka resume DIR"]


def test_a_person_who_rejects_all_that_trained_is_the_reason_that_nothing_was_found(tmp_path: Path) -> None:
    view = RunView.read(search_in(tmp_path, [reply(7), reply(8)]))
    vetoes = [Remark(kind=RemarkKind.VETO, place=Place(0, slot)) for slot in (0, 1)]
    rejected = replace(view, history=view.history.heard(vetoes), crown=None)
    assert verdict(rejected) == "No reward was found: a person vetoed every one that has a score."


def test_the_best_f_in_lists_of_runs_is_none_of_a_rejected_reward(tmp_path: Path) -> None:
    directory = search_in(tmp_path, [reply(7), reply(8)])
    with Store.open(directory, RunView.read(directory).config) as store:
        before = store.glance().fitness
        store.remarks.say(Remark(kind=RemarkKind.VETO, place=Place(0, 1)))
        assert store.glance().fitness == before, "the veto has not been heard yet"
        store.remarks.hear(0)
        ranking = Ranking(store.history())
        assert ranking.best is not None and store.glance().fitness == ranking.best.score != before


def test_before_the_end_nothing_is_claimed() -> None:
    assert verdict(run(HISTORY, BASELINES)) == "Not decided yet: the final trainings are not done."
    assert verdict(run(History((Generation(0, (refused(0, 0, "x"),)),)))) == "No reward has been trained yet."


@pytest.mark.parametrize(
    ("generated", "human", "sparse", "told"),
    [
        ((49.0, 51.0), (39.0, 41.0), 0.0, ("1.25", "1.25")),
        ((40.0, 42.0), (39.0, 41.0), 39.9, ("-", "-")),  # (41 - 39.9) / (40 - 39.9) = 11, but not decided
        ((49.0,), (40.0,), 0.0, ("-", "-")),
        ((49.0, 51.0), (39.0, 41.0), 50.0, ("-", "-")),  # the 0 of the scale would be above its 1
        ((49.0, 51.0), (39.0, 41.0), 40.0, ("-", "-")),
    ],
)
def test_a_score_is_told_where_it_is_decided_and_its_zero_is_below_its_one(
    generated: tuple[float, ...], human: tuple[float, ...], sparse: float, told: tuple[str, str]
) -> None:
    three = [SeedScores(training=scores, held_out=scores) for scores in (generated, human, (sparse,))]
    outcome = Outcome(best=None, method=three[0], human=three[1], sparse=three[2])
    assert tuple(value for _, value in measures(outcome).rows[:2]) == told
    assert (number(on_scale(outcome), 3), number(on_scale(outcome, training=True), 3)) == told


def test_every_account_of_a_run_tells_the_same_score(tmp_path: Path) -> None:
    """Where the seeds do not decide, no account tells a score."""
    view = ended([40.0, 42.0], [39.0, 41.0])
    sparse = Evaluation(lane="sparse-s1", fitness=0.0, episode_length=9.0, episodes=4)
    view = replace(view, evaluations={**view.evaluations, sparse.lane: sparse})
    assert view.outcome is not None and view.outcome.normalised is not None
    rows = re.findall(r"human-normalised score.*\| (\S+) \|", words(html.report(view, tmp_path)))
    assert rows == ["-"] and not any("ormalised" in line for line in summary(view))


def test_f_is_explained_for_tasks_that_are_installed() -> None:
    assert meaning(finished()) == "F: steps the pole stays up, from 0 to 499; higher is better."
    own = replace(finished(), config=replace(finished().config, env="someone_s.py:Task"))
    assert meaning(own) == "F is the task's own score; higher is better."


def test_a_search_that_found_nothing_says_why_and_where_to_read_more(tmp_path: Path) -> None:
    view = RunView.read(search_in(tmp_path, ["prose"] * 4, iteration=2))
    said = verdict(view)
    assert said.startswith("No reward was found: none of 4 slots left a policy with a score. The latest is g1s0: ")
    assert "the reply holds no Python function" in said and said in summary(view)
    assert commands(view) == [("eureka show DIR", "what became of each reply")]
