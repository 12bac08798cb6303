"""A person in the loop: given rewards, words, favourites, vetoes, votes, waiting, resuming and replaying."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
from loop.alone import Killed, run

from openeureka import strategies
from openeureka.config import RunConfig
from openeureka.errors import ConfigError, FeedbackError, ModelError, RewardFileError
from openeureka.events import nobody
from openeureka.score import Outcome
from openeureka.store import Store, read_replies, say
from openeureka.store.remarks import RemarkLog
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, program, reply
from openeureka.types import Generation, Place, Remark, RemarkKind, TrainingResult

GO = Remark(kind=RemarkKind.GO)
CONFIG = RunConfig(sample=2, iteration=2, repair=0, refill=0, seeds=1, feedback="human")
SCRIPT = [reply(7), reply(8), reply(1), reply(2)]


def words(text: str) -> Remark:
    return Remark(kind=RemarkKind.WORDS, text=text)


def favourite(generation: int, slot: int) -> Remark:
    return Remark(kind=RemarkKind.FAVOURITE, place=Place(generation, slot))


def veto(generation: int, slot: int) -> Remark:
    return Remark(kind=RemarkKind.VETO, place=Place(generation, slot))


def vote(better: tuple[int, int], worse: tuple[int, int]) -> Remark:
    return Remark(kind=RemarkKind.VOTE, place=Place(*better), over=Place(*worse))


@dataclass
class Person:
    """Says the remarks of each generation in turn, then `go`."""

    directory: Path
    remarks: list[list[Remark]]
    asked: list[int] = field(default_factory=list)

    def invite(self, generation: Generation) -> None:
        self.asked.append(generation.index)

    def listen(self, seconds: float) -> None:
        say(self.directory, *self.remarks[self.asked[-1]], GO)


class Silent:
    def invite(self, generation: Generation) -> None:
        self.left = 3

    def listen(self, seconds: float) -> None:
        """Nobody says anything. A fourth call means that the timeout was ignored."""
        self.left -= 1
        assert self.left >= 0


class Dying(Silent):
    """Says its remarks, and is killed before the run can go on."""

    def __init__(self, directory: Path, *remarks: Remark) -> None:
        self.directory, self.remarks = directory, remarks

    def listen(self, seconds: float) -> None:
        say(self.directory, *self.remarks)
        raise Killed


@dataclass
class Search:
    directory: Path
    config: RunConfig
    model: ScriptedModel
    trainer: ToyTrainer = field(default_factory=ToyTrainer)

    def go(self, desk: Any = None) -> Outcome:
        with Store.open(self.directory, self.config) as store:
            strategy = strategies.make(self.config)
            return run(self.config, store, self.model, ToyChecker(), self.trainer, TOY, strategy, nobody, desk)

    def heard(self, *remarks: list[Remark]) -> tuple[Outcome, Person]:
        desk = Person(self.directory, list(remarks))
        return self.go(desk), desk

    def asked(self, generation: int) -> str:
        """The last message of the request for a generation of the model."""
        return self.model.prompts[generation].messages[-1].content

    def parent(self, generation: int) -> str:
        return self.model.prompts[generation].messages[-2].content

    def history(self):
        with Store.view(self.directory) as store:
            return store.history()


@pytest.fixture
def begin(tmp_path: Path) -> Callable[..., Search]:
    def begin(script: list[str] = SCRIPT, name: str = "run", **settings: Any) -> Search:
        return Search(tmp_path / name, replace(CONFIG, **settings), ScriptedModel(script))

    return begin


# --- what is said ---


def test_words_are_in_the_next_prompt_and_those_of_all_generations_in_later_ones(begin) -> None:
    one = begin([*SCRIPT, reply(3), reply(4)], iteration=3)
    _, person = one.heard([words("too jerky")], [words("keep\nthe torso upright")])
    assert person.asked == [0, 1]  # nothing follows the last generation
    assert "too jerky" not in one.asked(0)
    assert "> too jerky\n" in one.asked(1)
    assert "> too jerky\n> keep\n> the torso upright\n" in one.asked(2)
    assert one.history().generations[0].remarks == (words("too jerky"), GO)


def test_one_sample_a_generation_and_words_alone_steer_a_search(begin) -> None:
    one = begin([reply(7), reply(8)], sample=1)
    outcome, _ = one.heard([words("slower")])
    assert "> slower\n" in one.asked(1) and program(7) in one.parent(1)
    assert outcome.best is not None and outcome.best.fitness == 8


def test_a_favourite_is_the_next_parent_though_another_has_higher_f(begin) -> None:
    one = begin()
    outcome, _ = one.heard([favourite(0, 0)])
    assert program(7) in one.parent(1)
    assert "They chose the last reward function above" in one.asked(1)
    assert outcome.best is not None and outcome.best.fitness == 8  # F still judges the end


def test_a_vetoed_candidate_is_neither_parent_nor_best_and_the_model_is_told(begin) -> None:
    one = begin()
    outcome, _ = one.heard([veto(0, 1)])
    assert program(7) in one.parent(1)
    assert "They rejected the policy of this reward function:\n```python\n" + program(8) in one.asked(1)
    assert outcome.best is not None and outcome.best.fitness == 7


def test_where_all_candidates_are_vetoed_no_best_is_left(begin) -> None:
    one = begin(script=[reply(7), reply(8), "no program", "nor this"])
    outcome, _ = one.heard([veto(0, 0), veto(0, 1)])
    assert outcome == Outcome(best=None)
    with Store.view(one.directory) as store:
        assert store.best() is None and not [*(one.directory / "best").iterdir()]


def test_a_veto_after_the_last_generation_takes_the_rejected_reward_out_of_best(begin) -> None:
    one = begin(judge="votes", iteration=1)
    assert one.heard([veto(0, 0), veto(0, 1)])[0] == Outcome(best=None)
    assert not [*(one.directory / "best").iterdir()]


def test_votes_choose_parent_and_best_where_they_judge(begin) -> None:
    one = begin(judge="votes")
    outcome, person = one.heard([vote((0, 0), (0, 1))], [vote((1, 0), (0, 0))])
    assert person.asked == [0, 1]  # the last generation needs votes too
    assert program(7) in one.parent(1)
    assert "They preferred its policy in 1 of 1 comparisons." in one.asked(1)
    assert outcome.best is not None and outcome.best.fitness == 1  # g1s0 beat g0s0, which beat g0s1
    assert (one.directory / "best" / "reward.py").read_text() == program(1)


class WithoutFitness(ToyTrainer):
    def result(self, lane) -> TrainingResult:
        return replace(super().result(lane), fitness=None)


def test_votes_judge_a_task_that_never_defines_f(begin) -> None:
    one = begin()
    one.trainer = WithoutFitness()
    outcome, _ = one.heard([vote((0, 0), (0, 1))])
    assert program(7) in one.parent(1)
    assert outcome.best is not None and outcome.best.sample.place == Place(0, 0)


def test_a_megabyte_of_words_and_escapes_are_cut_and_inert_in_a_prompt(begin) -> None:
    one = begin()
    one.heard([words("\x1b[31m\u202e" + "x" * 1_000_000 + "the end"), words("newest")])
    asked = one.asked(1)
    assert len(asked) < 10_000
    assert "\x1b" not in asked and "\u202e" not in asked
    assert "> newest\n" in asked


# --- waiting ---


def test_after_the_timeout_the_search_goes_on_without_a_word(begin) -> None:
    one = begin(feedback_timeout=1e-9)
    assert one.go(Silent()).best is not None
    assert one.history().generations[0].remarks == ()
    assert "A person" not in one.asked(1)


def test_what_was_said_before_the_process_died_is_heard_by_the_next_one_once(begin) -> None:
    one = begin()
    with pytest.raises(Killed):
        one.go(Dying(one.directory, words("too jerky")))
    assert one.model.said == 2
    one.heard([words("and too slow")])
    assert one.model.said == 4
    assert one.history().generations[0].remarks == (words("too jerky"), words("and too slow"), GO)
    assert one.asked(1).count("too jerky") == 1


def test_what_is_said_while_a_generation_trains_counts_for_the_next_prompt(begin) -> None:
    one = begin()
    train = one.trainer.train

    def training(*args):
        if one.model.said == 2:
            say(one.directory, words("early bird"))
        return train(*args)

    one.trainer.train = training
    one.heard([])
    assert "> early bird\n" in one.asked(1)


def test_a_go_said_while_a_generation_trains_is_refused_and_skips_no_wait(begin) -> None:
    one = begin()
    train = one.trainer.train

    def training(*args):
        if one.model.said == 2:
            with pytest.raises(FeedbackError, match="has no new policies to judge yet"):
                say(one.directory, words("early"), GO)
        return train(*args)

    one.trainer.train = training
    _, person = one.heard([words("seen")])
    assert person.asked == [0]
    assert one.history().generations[0].remarks == (words("seen"), GO)


def test_after_the_timeout_a_late_go_is_refused(begin) -> None:
    one = begin([*SCRIPT, reply(3), reply(4)], iteration=3, feedback_timeout=1e-9)
    train = one.trainer.train

    def training(*args):
        if one.model.said == 4:  # generation 1 trains: the wait after generation 0 is over
            with pytest.raises(FeedbackError, match="has no new policies to judge yet"):
                say(one.directory, GO)
        return train(*args)

    one.trainer.train = training
    one.go(Silent())
    assert not any(generation.remarks for generation in one.history().generations)


def test_a_go_said_while_a_run_waits_survives_a_kill(begin) -> None:
    one = begin()
    with pytest.raises(Killed):
        one.go(Dying(one.directory, GO))
    one.go(Silent())
    assert one.history().generations[0].remarks == (GO,)


def test_a_run_that_does_not_listen_or_is_over_says_so(begin) -> None:
    deaf = begin(feedback="none", name="deaf")
    deaf.go()
    with pytest.raises(FeedbackError, match="start one with feedback=human"):
        say(deaf.directory, GO)
    one = begin()
    one.heard([])
    with pytest.raises(FeedbackError, match="it hears no more"):
        say(one.directory, GO)


def test_a_remark_on_an_unknown_candidate_is_refused_with_those_there_are(begin) -> None:
    one = begin()
    with pytest.raises(FeedbackError, match="g0s7 is not a trained candidate .* there are g0s0, g0s1"):
        one.heard([words("kept together"), veto(0, 7)])
    with Store.view(one.directory) as store:
        assert store.remarks.unheard() == ()  # all are kept or none


def test_a_favourite_that_was_vetoed_is_refused(begin) -> None:
    one = begin()
    with pytest.raises(FeedbackError, match="^g0s1 was vetoed, which cannot be undone; choose another favourite.$"):
        one.heard([veto(0, 1), favourite(0, 1)])
    say(one.directory, veto(0, 1))
    with pytest.raises(FeedbackError, match="^g0s1 was vetoed"):
        say(one.directory, favourite(0, 1))
    say(one.directory, favourite(0, 0))


def test_votes_need_someone_who_votes() -> None:
    with pytest.raises(ConfigError, match="add feedback=human"):
        RunConfig(judge="votes")


# --- replaying ---


def test_a_replay_repeats_what_was_said_and_asks_nobody(begin) -> None:
    one = begin(judge="votes")
    first, _ = one.heard([words("too jerky"), favourite(0, 0)], [vote((1, 1), (0, 0))])
    said = [answer.text for answer in read_replies(one.directory)]
    two = begin(said, name="replay", judge="votes", model=f"replay:{one.directory}")
    assert two.go(Silent()) == first
    assert two.history() == one.history()
    assert two.model.prompts == one.model.prompts


def test_a_replay_repeats_what_was_said_though_something_was_said_to_it_and_only_once(begin) -> None:
    one = begin()
    one.heard([words("too jerky")])
    two = begin(name="replay", model=f"replay:{one.directory}")
    Store.open(two.directory, two.config).close()
    with pytest.raises(FeedbackError, match="replays the feedback of another run. To give feedback of your own"):
        say(two.directory, words("mine"))
    with Store.visit(two.directory) as store:  # which earlier versions allowed
        store.remarks.say(words("mine"))

    def killed(*_: object) -> None:
        raise Killed

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(RemarkLog, "hear", killed)
        with pytest.raises(Killed):
            two.go(Silent())
    two.go(Silent())
    assert two.history().generations[0].remarks == (words("mine"), words("too jerky"), GO)


def test_a_replay_that_has_not_the_candidates_that_were_spoken_of_says_so_and_keeps_nothing(begin) -> None:
    one = begin()
    one.heard([favourite(0, 1)])
    two = begin(name="replay", sample=1, model=f"replay:{one.directory}")
    with pytest.raises(ModelError, match=r"g0s1 is not a trained candidate .* Use the same env, sample"):
        two.go(Silent())
    with Store.view(two.directory) as store:
        assert not store.remarks.unheard()


# --- given rewards ---


def test_a_given_reward_is_generation_0_and_the_parent_of_the_first_of_the_model(begin, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(program(3))
    one = begin(init=str(tmp_path / "mine.py"), feedback="none")
    outcome = one.go()
    sizes = [len(generation.entries) for generation in one.history().generations]
    assert sizes == [1, 2, 2]  # iteration=2 counts the generations of the model
    assert program(3) in one.parent(0) and "task_score: [none, 1.50, 3.00]" in one.asked(0)
    assert outcome.best is not None and outcome.best.fitness == 8
    with Store.view(one.directory) as store:
        given = store.talk.reply(0, 0, 0)
        assert given is not None and (given.model, given.usage.cost_usd) == ("given", 0.0)
        assert len(store.talk.replies()) == 4  # those of the model, which a replay repeats


def test_a_resumed_run_needs_the_given_file_no_more(begin, tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(program(3))
    one = begin(init=str(path))
    with pytest.raises(Killed):
        one.go(Dying(one.directory))
    path.unlink()
    one.heard([], [])
    assert program(3) in one.parent(0)


def test_a_given_reward_that_is_refused_stops_the_run_and_can_be_corrected(begin, tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text("def compute_reward(x):\n    return x\n")
    one = begin(init=str(path), feedback="none")
    with pytest.raises(RewardFileError, match="refused: line 1: nothing is returned"):
        one.go()
    assert one.model.said == 0
    path.write_text(program(3))
    assert one.go().best is not None


def test_a_given_reward_may_hold_a_fence_in_its_docstring(begin, tmp_path: Path) -> None:
    given = program(3).replace("\n", '\n    """As in\n    ```\n    x = 3\n    ```\n    """\n', 1)
    (tmp_path / "mine.py").write_text(given)
    one = begin(init=str(tmp_path / "mine.py"), feedback="none")
    one.go()
    candidate = one.history().generations[0].entries[0].sample.candidate
    assert candidate is not None and candidate.source == given


def test_a_given_file_that_is_missing_is_named(begin, tmp_path: Path) -> None:
    with pytest.raises(RewardFileError, match="Cannot read the reward file"):
        begin(init=str(tmp_path / "none.py")).go()
