"""The whole loop with a scripted model, a toy checker and a toy trainer."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Any

import pytest
from sandbox.states import recorded

from loop.alone import run
from openeureka import strategies
from openeureka.config import RunConfig
from openeureka.errors import BudgetError, ModelError, WorkerError
from openeureka.events import Began, Checked, Event, Tell, nobody
from openeureka.llm.random import RandomModel
from openeureka.method import baselines, race
from openeureka.method.baselines import Baselines
from openeureka.method.lanes import CHOOSING, HELD_OUT
from openeureka.method.sampling import Sampler, request_seed
from openeureka.sandbox import confine
from openeureka.sandbox.client import Sandbox
from openeureka.score import Outcome, SeedScores
from openeureka.store import Store, read_replies
from openeureka.testing.hostile import CORPUS, STATE
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, program, reply
from openeureka.types import (
    Candidate,
    Generation,
    History,
    Message,
    Prompt,
    PromptPlan,
    Reply,
    StateSpec,
    StateVar,
    TrainingResult,
    TrainingState,
    Usage,
    VerdictCode,
)

REFUSED = "```python\ndef compute_reward(x):\n    return x\n```"
CONFIG = RunConfig(sample=2, iteration=1, repair=0, refill=0, seeds=2)


@dataclass
class Search:
    """A run directory and its fakes; `go` begins or resumes it."""

    directory: Path
    config: RunConfig
    model: ScriptedModel
    checker: ToyChecker = field(default_factory=ToyChecker)
    trainer: ToyTrainer = field(default_factory=ToyTrainer)
    tell: Tell = nobody

    def go(self) -> Outcome:
        with Store.open(self.directory, self.config) as store:
            strategy = strategies.make(self.config)
            return run(self.config, store, self.model, self.checker, self.trainer, TOY, strategy, self.tell)

    def history(self):
        with Store.view(self.directory) as store:
            return store.history()


@pytest.fixture
def begin(tmp_path: Path):
    def begin(script: Sequence[str], name: str = "run", **settings: Any) -> Search:
        return Search(tmp_path / name, replace(CONFIG, **settings), ScriptedModel(script))

    return begin


def lane(worth: float, seed: int) -> str:
    return f"{Candidate.of(program(worth)).id}-s{seed}"


def test_the_best_program_is_retrained_with_fresh_seeds_beside_the_human_reward(begin) -> None:
    one = begin([reply(7), reply(8)], seeds=2)
    outcome = one.go()
    assert one.trainer.trained == [
        *(lane(7, 0), lane(8, 0), "human-s0", "sparse-s0"),
        *(lane(8, 1), lane(8, 2), "human-s1", "human-s2"),
    ]
    # ToyTrainer: F = worth + seed / 100, and one less when held out.
    assert outcome.method.training == pytest.approx((8.01, 8.02))
    assert outcome.method.held_out == pytest.approx((7.01, 7.02))
    # The baselines' trainings beside the first generation count as well: they were not picked by their scores.
    assert outcome.human.training == pytest.approx((10.0, 10.01, 10.02))
    assert outcome.sparse.training == (5.0,)
    assert outcome.normalised == pytest.approx((8.015 - 5) / (10.01 - 5))
    assert outcome.correlation == 0.5
    assert outcome.curve_correlation == pytest.approx(1.0)  # (0, w/2, w) against (0, 1, 2)


def test_known_baselines_are_not_trained_again(begin, monkeypatch) -> None:
    def known(env: str, *, played: bool) -> Baselines:
        assert (env, played) == ("cartpole", True)
        return Baselines(
            human=SeedScores(training=(9.0,), held_out=(9.0, 11.0)),
            sparse=SeedScores(training=(5.0,), held_out=(2.0,)),
            env_steps=10, worlds=1, device="a GPU", date="2026-01-01",
        )  # fmt: skip

    monkeypatch.setattr(baselines, "known", known)
    one = begin([reply(7), reply(8)], seeds=2, baselines="known")
    outcome = one.go()
    assert one.trainer.trained == [lane(7, 0), lane(8, 0), lane(8, 1), lane(8, 2)]
    assert outcome.human.held_out == (9.0, 11.0)
    # held out 7.01 and 7.02: (7.015 - 2) / (10 - 2)
    assert outcome.normalised == pytest.approx(5.015 / 8)


def test_best_holds_the_program_and_the_policy_of_the_better_final_seed(begin) -> None:
    one = begin([reply(7), reply(8)], seeds=2)
    one.go()
    assert (one.directory / "best" / "reward.py").read_text() == program(8)
    assert (one.directory / "best" / "policy.safetensors").read_bytes() == b"8.02"


def test_a_finished_run_asks_and_trains_nothing_when_run_again(begin) -> None:
    one = begin([reply(7), reply(8)])
    first = one.go()
    asked, trained = one.model.said, list(one.trainer.trained)
    assert one.go() == first
    assert (one.model.said, one.trainer.trained) == (asked, trained)
    with Store.view(one.directory) as store:
        log = store.lanes
        known = log.results(), log.evaluations(), log.tryouts()
        assert race.outcome(one.config, store.history(), store.crown(), *known) == first


def test_equal_programs_are_checked_and_trained_once(begin) -> None:
    one = begin([reply(7), "Again:\n" + reply(7), reply(7), reply(6)], iteration=2)
    one.go()
    assert one.checker.checked == [program(7), program(6)]
    assert one.trainer.trained.count(lane(7, 0)) == 1
    slots = one.history().generations[0].entries
    assert [entry.fitness for entry in slots] == [7, 7]


def test_programs_that_differ_in_a_comment_train_once_and_share_the_result(begin) -> None:
    twin = reply(7).replace("return 7", "# the same\n    return 7")
    one = begin([reply(7), twin])
    one.go()
    assert len(one.checker.checked) == 2
    first, second = one.history().generations[0].entries
    assert first.sample.candidate != second.sample.candidate
    assert (first.fitness, second.fitness) == (7, 7)
    assert [lane for lane in one.trainer.trained if lane.endswith("-s0")] == [lane(7, 0), "human-s0", "sparse-s0"]


def test_a_program_that_repeats_another_of_the_run_is_sampled_anew(begin) -> None:
    twin = reply(7).replace("return 7", "# the same\n    return 7")
    one = begin([reply(7), twin, reply(8), reply(5), reply(7), reply(6)], iteration=2, refill=1)
    one.go()
    first, second = one.history().generations
    assert [(entry.fitness, entry.sample.attempts) for entry in first.entries] == [(7, 1), (8, 2)]
    assert [(entry.fitness, entry.sample.attempts) for entry in second.entries] == [(5, 1), (6, 2)]


def test_a_repetition_is_kept_where_nothing_else_comes(begin) -> None:
    one = begin([reply(7), reply(7), REFUSED], repair=1, refill=1)
    one.go()
    first, second = one.history().generations[0].entries
    assert (first.fitness, second.fitness) == (7, 7)
    assert (first.sample.attempts, second.sample.attempts) == (1, 3)
    assert one.model.said == 3  # two and a refill; a repeated program needs no repair


def test_a_refused_program_takes_its_repair_turns_before_its_slot_is_sampled_anew(begin) -> None:
    other = REFUSED.replace("return x", "return -x")
    script = [f"Sure!\n{REFUSED}", reply(7), other, REFUSED, reply(8)]
    one = begin(script, repair=2, refill=1)
    one.go()
    first, repair, again, fresh = one.model.prompts
    assert repair.messages[-2].content == REFUSED
    assert "line 1: nothing is returned [no-number]; return a number" in repair.messages[-1].content
    assert again.messages[-2].content == other
    assert fresh == first
    slots = one.history().generations[0].entries
    assert [(entry.fitness, entry.sample.attempts) for entry in slots] == [(8, 4), (7, 1)]


def test_a_slot_is_given_up_when_its_attempts_are_spent(begin) -> None:
    one = begin(["prose", reply(7), REFUSED, "prose", REFUSED], repair=1, refill=1)
    one.go()
    lost, kept = one.history().generations[0].entries
    assert (lost.sample.verdict.code, lost.sample.attempts, lost.result) == (VerdictCode.REFUSED, 4, None)
    assert lost.feedback == (
        "The reward function could not be used:\n- line 1: nothing is returned [no-number]; return a number"
    )
    assert kept.fitness == 7


def test_when_nothing_trains_the_model_is_told_why_and_the_search_goes_on(begin) -> None:
    one = begin(["prose", REFUSED, reply(7), reply(8)], iteration=2)
    outcome = one.go()
    told = [message.content for message in one.model.prompts[1].messages]
    assert any("no Python function [no-program]" in text for text in told)
    assert any("nothing is returned [no-number]" in text for text in told)
    assert outcome.best is not None and outcome.best.fitness == 8


def test_a_search_in_which_nothing_ever_trains_ends_without_a_best(begin) -> None:
    one = begin(["prose"] * 4, iteration=2)
    assert one.go() == Outcome(best=None)
    assert one.trainer.trained == ["human-s0", "sparse-s0"]


def test_the_next_prompt_holds_the_parent_and_its_feedback(begin) -> None:
    one = begin([reply(7), reply(8), reply(1), reply(2)], iteration=2)
    one.go()
    parent, feedback = one.model.prompts[1].messages[-2:]
    assert program(8) in parent.content
    assert "task_score: [none, 4.00, 8.00], Max: 8.00, Mean: 6.00, Min: 4.00" in feedback.content


@pytest.mark.parametrize(("name", "parent"), [("eureka", 2), ("best", 8)])
def test_eureka_follows_the_last_generation_and_best_the_best_so_far(begin, name: str, parent: float) -> None:
    one = begin([reply(7), reply(8), reply(1), reply(2), reply(3), reply(4)], iteration=3, search=name)
    outcome = one.go()
    assert program(parent) in one.model.prompts[2].messages[-2].content
    assert outcome.best is not None and outcome.best.fitness == 8


def test_the_model_is_closed_before_each_training(begin) -> None:
    one = begin([reply(7), reply(8), reply(1), reply(2)], iteration=2)
    closed: list[int] = []
    train = one.trainer.train
    one.trainer.train = lambda *args: closed.append(one.model.closed) or train(*args)
    one.go()
    assert closed == [1, 2, 2]  # the final trainings follow no request


def test_requests_have_seeds_of_their_own(begin) -> None:
    one = begin([REFUSED, REFUSED, reply(7), reply(8), reply(1), reply(2)], refill=1, iteration=2)
    one.go()
    assert len(set(one.model.seeds)) == len(one.model.seeds) == 3
    assert request_seed(0, 0, 0, 3) - request_seed(0, 0, 0, 1) == 2
    assert all(0 <= request_seed(seed, 9, 9, 99) < 2**31 for seed in range(100))


def test_whatever_a_run_draws_follows_from_its_seed(tmp_path: Path) -> None:
    drawn, played = list[float](), set[int]()

    class Draws(strategies.Best):
        def ask(self, history: History, rng: Random) -> Sequence[PromptPlan]:
            drawn.append(rng.random())
            return strategies.Best.ask(self, history, rng)

    class Noting(ToyTrainer):
        def evaluate(self, env, policies, *, seed, **options):
            played.add(seed)
            return super().evaluate(env, policies, seed=seed, **options)

    config = replace(CONFIG, seed=7, iteration=2, schedule="halving")
    model = ScriptedModel([reply(worth) for worth in (7, 8, 9, 6)])
    with Store.open(tmp_path, config) as store:
        run(config, store, model, ToyChecker(), Noting(error=1.0), TOY, Draws(samples=2))
    assert drawn == [Random(f"7/{index}").random() for index in (0, 1)]
    # Seeds of start states: two looks to choose by, of which the first is also that of rungs, and the held-out scores.
    assert played == {CHOOSING + 7, CHOOSING + 8, HELD_OUT + 7}
    assert model.seeds == [request_seed(7, index, 0, 0) for index in (0, 1)]
    assert len({request_seed(seed, 0, 0, 0) for seed in range(100)}) == 100


def test_the_rest_of_an_interrupted_refill_has_the_seeds_that_it_would_have_had(begin) -> None:
    """Slots 0 and 2 are sampled again. The run is stopped after slot 0."""

    @dataclass
    class Ending(ScriptedModel):
        ends: int = 0

        def sample(self, prompt, *, n: int, seed: int):
            for index, text in enumerate(super().sample(prompt, n=n, seed=seed)):
                if self.said > self.ends:
                    raise KeyboardInterrupt
                self.seeds[-1:] = [seed + index]
                yield text

    one = begin([REFUSED, reply(7), REFUSED, reply(8), reply(6)], sample=3, refill=1)
    texts, one.model = one.model.script, Ending(one.model.script, ends=4)
    with pytest.raises(KeyboardInterrupt):
        one.go()
    first = one.model.seeds[-1]
    one.model = Ending(texts, said=4, ends=5)
    one.go()
    assert one.model.seeds == [first + 1]


def test_chance_draws_the_rest_of_an_interrupted_request_as_it_would_have(tmp_path: Path) -> None:
    class Ending(RandomModel):
        def sample(self, prompt, *, n: int, seed: int):
            for index, drawn in enumerate(super().sample(prompt, n=n, seed=seed)):
                if index == 2:
                    raise KeyboardInterrupt
                yield drawn

    speed = StateVar(name="speed", meaning="how fast", use="directional")
    context = replace(TOY, state=StateSpec((speed,)))
    config = replace(CONFIG, sample=5)

    def draw(name: str, model: RandomModel) -> list[str]:
        with Store.open(tmp_path / name, config) as store:
            Sampler(config, store, model, ToyChecker(), context, nobody).fill(0, [PromptPlan(count=5)])
        return [one.text for one in read_replies(tmp_path / name)]

    with pytest.raises(KeyboardInterrupt):
        draw("stopped", Ending())
    assert len(read_replies(tmp_path / "stopped")) == 2
    assert draw("stopped", RandomModel()) == draw("whole", RandomModel())


class Interrupted(ScriptedModel):
    """Loses its connection after some replies."""

    lost_after = 1

    def sample(self, prompt, *, n, seed):
        for number, answer in enumerate(super().sample(prompt, n=n, seed=seed)):
            if number == self.lost_after:
                self.said -= 1
                raise ModelError("The connection was lost.")
            yield answer


def test_replies_before_a_lost_connection_are_not_asked_for_again(begin) -> None:
    one = begin([reply(7), reply(8), reply(9)], sample=3)
    one.model = Interrupted(one.model.script)
    with pytest.raises(ModelError):
        one.go()
    one.model = ScriptedModel(one.model.script, said=1)
    outcome = one.go()
    assert one.model.said == 3
    assert outcome.best is not None and outcome.best.fitness == 9


class Miscounting(ScriptedModel):
    more = 0

    def sample(self, prompt, *, n, seed):
        return super().sample(prompt, n=n + self.more, seed=seed)


def test_a_model_that_gives_fewer_replies_ends_the_run_in_a_sentence_and_one_that_gives_more_does_not(begin) -> None:
    one = begin([reply(7), reply(8), reply(9)])
    one.model = Miscounting(one.model.script)
    one.model.more = -1
    with pytest.raises(ModelError, match="scripted gave 1 of 2 replies: its `sample` must yield n replies"):
        one.go()
    one.model = Miscounting([reply(8), reply(9)])  # the first reply of before is kept
    one.model.more = 1
    assert one.go().best.fitness == 8


def test_spending_stops_before_the_limit_and_goes_on_with_a_higher_one(begin) -> None:
    one = begin([reply(7), reply(8), reply(9), reply(10)], iteration=2, max_cost=0.035)  # a reply costs 0.01
    with pytest.raises(BudgetError, match=r"max_cost=0\.035"):
        one.go()
    assert one.model.said == 2
    assert strategies.Ranking(one.history()).best.fitness == 8
    one.config = replace(one.config, max_cost=0.05)
    assert one.go().best.fitness == 10


def test_what_proposals_of_ranges_cost_counts_as_spent(begin) -> None:
    one = begin([reply(7), reply(8), reply(9), reply(10)], iteration=2, max_cost=0.03)  # a reply costs 0.01
    with pytest.raises(BudgetError, match=r": 0\.02 are spent"):
        one.go()
    proposal = Reply(text="mass: [0.9, 1.1]", model="scripted", usage=Usage(cost_usd=0.03))
    with Store.open(one.directory, one.config) as store:
        store.talk.save_proposal(0, 0, Prompt(messages=(Message("user", "Which ranges?"),)), proposal)
    one.config = replace(one.config, max_cost=0.05)  # enough for four replies, were it not for the proposal
    with pytest.raises(BudgetError, match=r": 0\.05 are spent"):
        one.go()


def test_a_replay_of_the_replies_is_the_same_search(begin) -> None:
    script = ["prose", reply(7), REFUSED, reply(6), reply(8), reply(9)]
    one = begin(script, iteration=2, repair=1, refill=1)
    first = one.go()
    texts = [said.text for said in read_replies(one.directory)]
    two = begin(texts, name="replay", iteration=2, repair=1, refill=1, model="replay:run")
    assert two.go() == first
    assert two.history() == one.history()


class Diverging(ToyTrainer):
    def result(self, lane):
        result = super().result(lane)
        if lane.id.startswith(("human", "sparse")):
            return result
        curves = {name: (float("nan"),) for name in result.curves}
        state, message = TrainingState.DIVERGED, "reward was NaN"
        return replace(
            result, state=state, message=message, fitness=None, curves=curves, best_fitness=None, best_reward=None
        )


def test_a_diverged_lane_never_wins_and_its_author_is_told(begin) -> None:
    one = begin([reply(7), reply(8)])
    one.trainer = Diverging()
    assert one.go().best is None
    assert "stopped early (reward was NaN)" in one.history().generations[0].entries[0].feedback


class Failing(ToyTrainer):
    """Its worker dies of programs worth 7, or of every program."""

    def __init__(self, *, everything: bool = False) -> None:
        super().__init__()
        self.everything = everything

    def result(self, lane):
        result = super().result(lane)
        if not self.everything and result.fitness != 7:
            return result
        return replace(result, state=TrainingState.FAILED, message="out of memory", fitness=None, curves={},
                       best_fitness=None, best_reward=None)  # fmt: skip


def test_a_lane_that_kills_its_worker_is_recorded_and_the_search_goes_on(begin) -> None:
    one = begin([reply(7), reply(8)])
    one.trainer = Failing()
    best = one.go().best
    assert best is not None and best.fitness == 8
    assert "No policy could be trained" in one.history().generations[0].entries[0].feedback


def test_when_no_lane_can_train_the_run_stops_and_can_be_resumed(begin) -> None:
    one = begin([reply(6), reply(8)])
    one.trainer = Failing(everything=True)
    with pytest.raises(WorkerError, match="out of memory"):
        one.go()
    one.trainer = ToyTrainer()
    best = one.go().best
    assert best is not None and best.fitness == 8 and one.model.said == 2


@pytest.mark.parametrize("stopped", [False, True])
def test_a_baseline_that_ends_its_worker_beside_others_that_train_stops_nothing(begin, stopped: bool) -> None:
    """The same holds if the others trained before the run was stopped."""

    class Fragile(ToyTrainer):
        dies = stopped

        def train(self, env: str, lanes, budget):
            lost = [spec for spec in lanes if spec.id.startswith("sparse")]
            yield from super().train(env, [spec for spec in lanes if spec not in lost], budget)
            if self.dies:
                raise KeyboardInterrupt
            for spec in lost:
                yield TrainingResult(
                    lane=spec.id, state=TrainingState.FAILED, fitness=None, curves={}, env_steps=0, seconds=0.0,
                    message="out of memory",
                )  # fmt: skip

    one = begin([reply(6), reply(8)])
    one.trainer = Fragile()
    if stopped:
        with pytest.raises(KeyboardInterrupt):
            one.go()
        one.trainer.dies = False
    outcome = one.go()
    assert outcome.best is not None and outcome.best.fitness == 8 and outcome.sparse.scores == ()


def test_a_reward_that_alone_ends_its_worker_is_recorded_and_a_resumed_run_does_not_train_it_again(
    begin, monkeypatch
) -> None:
    """The baselines are known, so no human reward trains beside it. The trainer itself has found that one would."""
    measured = Baselines(
        human=SeedScores(training=(9.0,), held_out=(9.0,)), sparse=SeedScores(training=(5.0,), held_out=(2.0,)),
        env_steps=10, worlds=1, device="a GPU", date="2026-01-01",
    )  # fmt: skip
    monkeypatch.setattr(baselines, "known", lambda env, *, played: measured)
    one = begin([reply(6)], sample=1, baselines="known")
    one.trainer = Failing(everything=True)
    assert one.go().best is None
    assert one.go().best is None
    assert one.trainer.trained == [lane(6, 0)] and one.model.said == 1
    result = one.history().generations[0].entries[0].result
    assert result is not None and (result.state, result.message) == (TrainingState.FAILED, "out of memory")


HOSTILE_REPLIES = {
    "truncated-least-integer": "integer-division",
    "large-between-two-sizes": "memory",
    "worlds-beyond-the-recorded": "coupling",
    "huge-integer": "input-edit",
    "fences": "",
}


@pytest.fixture(scope="module")
def sandbox() -> Iterator[Sandbox]:
    if not confine.support().complete:
        pytest.skip(confine.support().sentence())
    with Sandbox(STATE, recorded()) as running:
        yield running


@pytest.mark.parametrize("stopped", [False, True], ids=["run", "resume"])
def test_a_run_goes_on_after_hostile_replies_with_verdicts_that_say_why(begin, sandbox, stopped: bool) -> None:
    sources = {hostile.name: hostile.source for hostile in CORPUS}
    sources["huge-integer"] = "def compute_reward(pos):\n    pos += 0x" + "F" * 6000 + "\n    return pos[:, 0], {}\n"
    texts = [f"```python\n{sources[name]}\n```" for name in HOSTILE_REPLIES if name in sources] + ["~" * 48000 + "`"]
    one = begin(texts, sample=len(texts))

    def stop(candidate: Candidate) -> None:
        raise KeyboardInterrupt

    if stopped:  # replies are stored, but no verdicts, as after a kill
        one.checker = SimpleNamespace(check=stop)
        with pytest.raises(KeyboardInterrupt):
            one.go()
    one.checker = sandbox
    assert one.go().best is None
    entries = one.history().generations[0].entries
    rules = [entry.sample.verdict.findings[0].rule if entry.sample.candidate else "" for entry in entries]
    assert rules == list(HOSTILE_REPLIES.values()) and one.model.said == len(texts)


def test_who_listens_is_told_what_happens_and_after_a_resumption_what_had_happened(begin) -> None:
    one, told = begin([reply(7), "prose"]), list[str]()

    def listen(event: Event) -> None:
        match event:
            case Began(phase, generation):
                told.append(phase if generation is None else f"{phase} {generation}")
            case Checked(sample):
                told.append(sample.verdict.code)
            case Generation():
                told.append(f"generation {event.index}")
            case Outcome():
                told.append("outcome")
            case _:
                pass

    one.tell = listen
    one.go()
    end = ["final", "evaluate", "outcome"]
    assert told == ["sample 0", "check 0", "accepted", "no_program", "train 0", "play 0", "generation 0", *end]
    told.clear()
    one.go()
    assert told == ["generation 0", *end]


def test_messages_json_holds_the_conversation_of_each_generation(begin) -> None:
    one = begin([reply(7), reply(8), reply(1), reply(2)], iteration=2)
    one.go()
    asked = json.loads((one.directory / "messages.json").read_text())
    assert [prompt["generation"] for prompt in asked] == [0, 1]
    assert program(8) in asked[1]["messages"][-2]["content"]
