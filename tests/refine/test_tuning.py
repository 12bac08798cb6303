"""The numbers of a reward are fitted: spoiled ones are found again, raced and kept, and a stopped tuning goes on."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random
from statistics import median

import pytest
from loop.alone import run

from openeureka import strategies
from openeureka.benchmark import figures
from openeureka.benchmark.plan import Cell
from openeureka.cli.show import summary
from openeureka.config import NO_MODEL, RunConfig
from openeureka.errors import StoreError
from openeureka.events import Began, Event, nobody
from openeureka.method.lanes import Lanes
from openeureka.method.sampling import Checker
from openeureka.method.seeds import unused_seed
from openeureka.refine import tuned, tuning
from openeureka.refine.tuned import ORIGINAL, Tuned, distinct, final_lanes
from openeureka.report import fitted, html, tables
from openeureka.report.next_steps import commands, deciding
from openeureka.report.verdict import of_tuning
from openeureka.report.view import RunView
from openeureka.reward.weights import weighed, weights
from openeureka.runs.run import Run
from openeureka.score import Outcome, SeedScores
from openeureka.stats import Difference, mean
from openeureka.store import Store
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, program
from openeureka.types import (
    Candidate,
    Checkpoint,
    Evaluation,
    Finding,
    LaneSpec,
    Node,
    Reply,
    RewardGraph,
    TrainingResult,
    TrainingState,
    Verdict,
    VerdictCode,
    lane_id,
)

HUMAN = """def compute_reward(speed, effort, posture, noise):
    reward = 2.0 * speed - 0.01 * effort + 0.5 * posture + 0.3 * noise
    return reward, {}
"""
PLAIN = "```python\ndef compute_reward(distance):\n    return distance\n```\n"
BEST = (2.0, 0.01, 0.5)
"""The first three numbers with which F is highest. The fourth does not matter."""


class Reader:
    """Accepts every text without a number above 1000. The graph holds the text's numbers."""

    def check(self, candidate: Candidate) -> Verdict:
        numbers = [weight.value for weight in weights(candidate.source)]
        if max(numbers) > 1000.0:
            return Verdict(candidate=candidate.id, code=VerdictCode.CONTRACT)
        nodes = tuple(Node("full", (number,)) for number in numbers)
        graph = RewardGraph(nodes=nodes, reward=0, components=())
        return Verdict(candidate=candidate.id, code=VerdictCode.ACCEPTED, graph=graph)


@dataclass
class Hill(ToyTrainer):
    """F is 100 with the numbers `BEST`, and falls by 4 log(own / best)**2 for each number."""

    noise: float = 0.0
    failing: Sequence[str] = field(default_factory=list)

    def result(self, lane: LaneSpec) -> TrainingResult:
        if lane.id in self.failing:
            return TrainingResult(
                lane=lane.id, state=TrainingState.DIVERGED, fitness=None, curves={}, env_steps=1, seconds=0.0
            )
        assert isinstance(lane.program, RewardGraph)
        numbers = [node.args[0] for node in lane.program.nodes]
        off = sum(math.log(own / best) ** 2 for own, best in zip(numbers, BEST, strict=False))  # pyright: ignore
        worth = 100.0 - 4.0 * off + self.noise * Random(lane.id).gauss(0, 1)
        graph = RewardGraph(nodes=(Node("full", (worth,)),), reward=0, components=())
        return super().result(replace(lane, program=graph))


def spoiled(seed: int) -> str:
    """The human reward with each number multiplied by e**U(-2, 2)."""
    rng = Random(seed)
    return weighed(HUMAN, [weight.value * math.exp(rng.uniform(-2, 2)) for weight in weights(HUMAN)])


def config(**settings) -> RunConfig:
    return RunConfig(**{"model": NO_MODEL, "tune": 32, "sample": 8, "seeds": 3, "video": "none"} | settings)


def go(directory: Path, trainer: ToyTrainer, text: str, *, checker: Checker | None = None, **settings) -> Tuned:
    wanted = config(**settings)
    with Store.open(directory, wanted) as store:
        candidate = Candidate.of(text)
        tuning.keep(store, candidate, (checker or Reader()).check(candidate))
        tuning.tune(Lanes(wanted, store, trainer, nobody), checker or Reader())
    found = RunView.read(directory).tuned
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(5))
def test_spoiled_numbers_find_the_way_back(tmp_path: Path, seed: int) -> None:
    trainer = Hill(noise=1.0, error=1.0)
    found = go(tmp_path, trainer, spoiled(seed), tune=48)
    before, after = (mean(found.finals[name].scores) or 0.0 for name in (ORIGINAL, found.after))
    # Played and held-out scores are one less than in training, so 99 is the highest. The fitted numbers must go three
    # quarters of the way there.
    assert after - before > 0.75 * (99.0 - before) - 1.0
    assert len([lane for lane in trainer.trained if lane.endswith("-s0")]) == 48
    assert (tmp_path / "best" / "reward.py").read_text() == found_text(found)


def found_text(found: Tuned) -> str:
    return next(trial.candidate.source for trial in found.trials if trial.name == found.after)


def test_what_decides_f_is_told_from_what_does_not(tmp_path: Path) -> None:
    off = weighed(HUMAN, [2.0, 0.1, 0.5, 0.3])  # effort ten times too high
    effects = {effect.weight.name: effect for effect in go(tmp_path, Hill(), off, tune=64, sample=16).effects}
    effort, noise = effects["reward 0.1"], effects["reward 0.3"]
    assert effort.matters and effort.trend is not None and effort.trend.high < 0  # less is better
    assert not noise.matters
    assert effort.after is not None and effort.after < 0.06


def test_of_a_negative_number_the_larger_is_the_one_nearer_to_zero(tmp_path: Path) -> None:
    class Penal(Reader):
        def check(self, candidate: Candidate) -> Verdict:
            (weight,) = weights(candidate.source)
            graph = RewardGraph(nodes=(Node("full", (abs(weight.value),)),), reward=0, components=())
            return Verdict(candidate=candidate.id, code=VerdictCode.ACCEPTED, graph=graph)

    text = "def compute_reward(effort):\n    return -50.0 * effort\n"  # -2 is the best
    (effect,) = go(tmp_path, Hill(), text, tune=24, checker=Penal()).effects
    assert effect.after is not None and effect.after > -50.0
    assert effect.trend is not None and effect.trend.low > 0
    assert fitted.numbers(RunView.read(tmp_path).tuned).rows[0][-1].startswith("more is better")


@pytest.mark.parametrize(
    ("tune", "sample", "sizes"), [(32, 16, [8] * 4), (16, 8, [4] * 4), (8, 8, [4] * 2), (64, 8, [8] * 8)]
)
def test_a_round_at_the_end_of_a_search_is_no_more_than_a_quarter_of_its_trainings_and_no_less_than_four(
    tune: int, sample: int, sizes: list[int]
) -> None:
    assert [len(own) for own in tuned.rounds(RunConfig(tune=tune, sample=sample))] == sizes
    alone = config(tune=tune, sample=sample)  # in `eureka tune`, `sample=` is the size of a round
    assert {len(own) for own in tuned.rounds(alone)} == {sample}


def test_the_text_as_it_came_is_the_first_of_the_first_round(tmp_path: Path) -> None:
    found = go(tmp_path, Hill(), HUMAN, tune=10, sample=4)
    assert [trial.name for trial in found.trials] == [ORIGINAL, *(f"trial_{number}" for number in range(1, 10))]
    assert found.trials[0].candidate.source == HUMAN
    assert found.trials[0].played == 99.0
    assert len({trial.values for trial in found.trials}) == 10


def test_a_text_that_a_search_cut_is_no_low_weighting(tmp_path: Path) -> None:
    """The score of half a training cannot be compared with those of whole ones. For the proposals it counts as the
    median."""

    class Halved(Hill):
        def result(self, lane: LaneSpec) -> TrainingResult:
            result = super().result(lane)
            if lane.id != lane_id(Candidate.of(HUMAN).id, 0):
                return result
            half = Checkpoint(epoch=1, value=2.0, policy=b"1.0")
            return replace(
                result, state=TrainingState.CUT, best_fitness=half, best_reward=half, last=b"1.0", fitness=2.0
            )

    found = go(tmp_path, Halved(), HUMAN, tune=10, sample=5)
    assert found.trials[0].played is None and found.trained == 10
    with Store.view(tmp_path) as store:
        lanes = Lanes(store.config, store, Halved(), nobody)
        _, scores = tuning._scores(lanes, [t.candidate for t in found.trials[:5]], found.trials[0].candidate)
        assert lanes.scores()[lane_id(found.trials[0].candidate.id, 0)].fitness == 0.0
    assert scores[0] == median([score for score in scores[1:] if score is not None])


def test_numbers_that_nothing_beats_stay_in_best(tmp_path: Path) -> None:
    found = go(tmp_path, Hill(), HUMAN)  # human numbers are the best there are
    assert (tmp_path / "best" / "reward.py").read_text() == HUMAN
    assert found.better == ORIGINAL and len(found.finals) == 3
    assert fitted.finals(RunView.read(tmp_path), found).note.endswith("best/ holds the original reward.")
    assert "The tuned numbers are worse than the original ones" in of_tuning(found)


def test_one_that_is_refused_or_diverges_is_the_worst_of_its_round(tmp_path: Path) -> None:
    wild = HUMAN.replace("0.3 * noise", "900.0 * noise")
    found = go(tmp_path / "a", Hill(), wild, tune=16)
    refused = [trial for trial in found.trials if max(trial.values) > 1000.0]
    assert refused and all(trial.played is None for trial in refused)
    assert found.trained == 16 - len(refused)
    lanes = [f"{trial.candidate.id}-s0" for trial in found.trials[1:4]]
    lame = go(tmp_path / "b", Hill(failing=lanes), wild, tune=16)
    assert [trial.played for trial in lame.trials[1:4]] == [None] * 3
    assert lame.after not in ("trial_1", "trial_2", "trial_3", "")


def test_where_no_weighting_trains_the_text_as_it_came_stays(tmp_path: Path) -> None:
    class Lame(Hill):
        def result(self, lane: LaneSpec) -> TrainingResult:
            own = f"{Candidate.of(HUMAN).id}-"
            return super().result(lane) if lane.id.startswith(own) else replace(
                super().result(lane), state=TrainingState.DIVERGED, fitness=None, best_fitness=None, best_reward=None
            )  # fmt: skip

    found = go(tmp_path, Lame(), HUMAN, tune=4, sample=4)
    assert found.after == "" and of_tuning(found).startswith(
        "The numbers stay unchanged: no other weighting left a policy"
    )
    assert (tmp_path / "best" / "reward.py").read_text() == HUMAN


def test_where_every_proposal_is_refused_the_verdict_says_why(tmp_path: Path) -> None:
    class Strict(Reader):
        def check(self, candidate: Candidate) -> Verdict:
            if candidate.source == HUMAN:
                return super().check(candidate)
            finding = Finding(rule="indices", message="slice indices must be integers", line=2)
            return Verdict(candidate=candidate.id, code=VerdictCode.CONTRACT, findings=(finding,))

    found = go(tmp_path, Hill(), HUMAN, tune=8, sample=4, checker=Strict())
    assert of_tuning(found) == (
        "The numbers stay unchanged: no other weighting left a policy that could be scored. 7 of 7 were "
        "refused or failed; the first, trial_1: line 2: slice indices must be integers [indices]."
    )


def test_where_every_other_training_dies_the_verdict_says_why(tmp_path: Path) -> None:
    class Dying(Hill):
        def result(self, lane: LaneSpec) -> TrainingResult:
            result = super().result(lane)
            if lane.id.startswith(Candidate.of(HUMAN).id):
                return result
            died = replace(result, state=TrainingState.FAILED, fitness=None, best_fitness=None, best_reward=None)
            return replace(died, last=None, message="Its worker ran out of memory.")

    found = go(tmp_path, Dying(), HUMAN, tune=4, sample=4)
    assert of_tuning(found).endswith("3 of 3 were refused or failed; the first, trial_1: Its worker ran out of memory.")


@dataclass
class Dear(ToyTrainer):
    """With fresh seeds, the second text is as good as the first, and leads. With the third one it breaks the limit."""

    seen: list[object] = field(default_factory=list)
    dear: str = "none"

    def result(self, lane: LaneSpec) -> TrainingResult:
        if isinstance(lane.program, str):
            return super().result(lane)
        if lane.program not in self.seen:
            self.seen.append(lane.program)
        place = self.seen.index(lane.program)
        if place == 1 and lane.seed == 7:
            self.dear = lane.id
        worth = {0: 90.0 if lane.seed else 50.0, 1: 90.0, 2: 89.95}.get(place, 10.0)
        return super().result(replace(lane, program=_worth(worth)))

    def evaluate(self, env, policies, *, seed, **options):
        for score in super().evaluate(env, policies, seed=seed, **options):
            yield replace(score, costs={"torque": 1000.0 if score.lane.startswith(self.dear) else 5.0})


def test_numbers_that_left_to_a_leader_that_breaks_a_limit_race_on(tmp_path: Path) -> None:
    wanted, trainer = RunConfig(sample=1, iteration=1, refill=0, seeds=4, tune=4, limits="torque=10"), Dear()
    with Store.open(tmp_path, wanted) as store:
        model = ScriptedModel([f"```python\n{program(7.0).replace('7.0', '7.0 * x')}```\n"])
        run(wanted, store, model, ToyChecker(), trainer, TOY, strategies.make(wanted))
    found = RunView.read(tmp_path).tuned
    assert found is not None and found.after == "trial_2"
    ids = {trial.name: trial.candidate.id for trial in found.trials}
    fresh = {name: [int(lane[-1]) for lane in trainer.trained if lane.startswith(ids[name])][1:] for name in ids}
    assert (fresh["trial_1"], fresh["trial_2"]) == ([5, 6, 7], [5, 6, 8])  # 1 to 4 are for the race of the search


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], Tuned]:
    """Lanes of a tuning that nobody stops, and what it found."""
    trainer = Hill(noise=2.0)
    found = go(tmp_path_factory.mktemp("whole"), trainer, spoiled(7), tune=16)
    return trainer.trained, found


@pytest.mark.parametrize("after", [0, 5, 9, 14, 17, 22])
def test_a_stopped_tuning_goes_on_and_trains_nothing_twice(
    whole: tuple[list[str], Tuned], tmp_path: Path, after: int
) -> None:
    @dataclass
    class Stopping(Hill):
        def result(self, lane: LaneSpec) -> TrainingResult:
            if len(self.trained) > after:
                raise KeyboardInterrupt
            return super().result(lane)

    first, second = Stopping(noise=2.0), Hill(noise=2.0)
    with pytest.raises(KeyboardInterrupt):
        go(tmp_path / "run", first, spoiled(7), tune=16)
    found = go(tmp_path / "run", second, spoiled(7), tune=16)
    assert ([*first.trained[:-1], *second.trained], found) == whole


def test_a_tuning_of_another_reward_is_refused(tmp_path: Path) -> None:
    go(tmp_path, Hill(), HUMAN, tune=4, sample=4)
    with pytest.raises(StoreError, match="tunes another reward"):
        go(tmp_path, Hill(), spoiled(1), tune=4, sample=4)


def test_a_tuning_of_other_numbers_than_count_by_now_says_so(tmp_path: Path) -> None:
    with Store.open(tmp_path, config()) as store:
        for name, text in ((ORIGINAL, HUMAN), ("trial_1", HUMAN.replace("speed, effort", "effort, speed"))):
            candidate = Candidate.of(text)
            store.rewards.save_verdict(candidate, Reader().check(candidate), Reply(text=text, model="given"))
            store.rewards.save_named({name: candidate.id})
        with pytest.raises(StoreError, match="fits other numbers of this reward; tune it again with another dir="):
            tuning.tune(Lanes(config(), store, Hill(), nobody), Reader())


def test_one_that_was_killed_before_it_had_its_reward_says_what_to_type(tmp_path: Path) -> None:
    with Store.open(tmp_path, config()) as store, pytest.raises(StoreError, match="the same `eureka tune` command"):
        tuning.tune(Lanes(config(), store, Hill(), nobody), Reader())


def test_a_single_number_is_fitted_too(tmp_path: Path) -> None:
    text = "def compute_reward(speed):\n    return 20.0 * speed\n"
    found = go(tmp_path, Hill(), text, tune=24)
    (effect,) = found.effects
    assert effect.after is not None and 1.0 < effect.after < 5.0  # 2 is the best


def test_a_text_that_was_proposed_twice_or_is_the_one_that_came_races_once() -> None:
    first, second = Candidate.of("a"), Candidate.of("b")
    texts = {"t0.1": first, ORIGINAL: first, "t0.2": second, "t1.0": second}
    assert dict(distinct(texts)) == {ORIGINAL: first, "t0.2": second}
    lanes = [lane_id(candidate.id, 1) for candidate in (first, second)]
    assert final_lanes(config(seeds=1), texts, lanes) == {ORIGINAL: lanes[:1], "t0.2": lanes[1:]}


def test_nothing_is_said_of_a_race_before_its_policies_are_judged(tmp_path: Path) -> None:
    going = SeedScores(training=(5.0, 6.0), held_out=(None, None))
    found = Tuned(trials=(), trained=0, effects=(), after="t0.1", finals={ORIGINAL: going, "t0.1": going})
    assert of_tuning(found) == "Not decided yet: the final trainings are not done."
    half = {ORIGINAL: SeedScores(training=(5.0,), held_out=(5.0,)), "t0.1": going}  # as in a search
    known = replace(found, finals=half)
    assert of_tuning(known) == "Not decided yet: the final trainings are not done."
    assert "with the tuned numbers, no final training left a policy" in of_tuning(replace(known, judged=True))
    Store.open(tmp_path, config()).close()
    run = RunView.read(tmp_path)
    assert "best/" not in fitted.finals(run, found).note and "noise" not in fitted.finals(run, found).note
    noisy = Evaluation(lane="a", fitness=1.0, episode_length=1.0, episodes=4, noisy=True)
    assert "actions keep the noise of training" in fitted.finals(replace(run, evaluations={"a": noisy}), found).note


# --- at the end of a search ------------------------------------------------------------------------------------------


def reply(worth: float) -> str:
    return f"```python\n{program(worth).replace(str(worth), f'{worth} * x')}```\n"


def test_a_search_fits_the_numbers_of_its_winner(tmp_path: Path) -> None:
    wanted = RunConfig(sample=2, iteration=1, repair=0, refill=0, seeds=2, tune=8)
    heard: list[Event] = []

    def search(trainer: ToyTrainer):
        with Store.open(tmp_path, wanted) as store:
            model = ScriptedModel([reply(7.0), reply(8.0)])
            model.said = len(store.talk.replies())
            return run(wanted, store, model, ToyChecker(), trainer, TOY, strategies.make(wanted), heard.append)

    trainer = ToyTrainer()
    outcome = search(trainer)
    assert outcome.best is not None and outcome.best.fitness == 8.0  # the search's own result stays what it is
    began = [event for event in heard if isinstance(event, Began) and event.phase in ("train", "final")]
    rounds = [Began("train", round=0), Began("train", round=1)]
    assert began == [Began("train", generation=0), Began("final"), *rounds, Began("final")]
    found = RunView.read(tmp_path).tuned
    assert found is not None and found.difference is not None and found.difference.sure
    own = outcome.best.candidate_id
    assert trainer.trained.count(f"{own}-s0") == trainer.trained.count(f"{own}-s1") == 1
    assert (tmp_path / "best" / "reward.py").read_text() == found_text(found)
    view = RunView.read(tmp_path)
    for text in ("\n".join(summary(view)), html.report(view, tmp_path)):
        assert "The best reward with fitted numbers" in text and of_tuning(found) in text
    assert view.fitted is not None and view.fitted.source.splitlines()[1] in re.sub("<[^>]+>", "", text)
    assert ", with the search's seed; shown with fitted numbers, see below." in html.report(view, tmp_path)
    with Store.view(tmp_path) as store:
        assert store.glance().fitness == view.ranking.best.score, "fitted numbers are no candidates"
    assert Run(tmp_path).finished
    told = figures.read(Cell("cartpole", "fitted", 0), tmp_path)  # a bench compares what is handed over
    assert told is not None and told.held_out == mean(found.finals[found.better].held_out) != mean(
        outcome.method.held_out
    )
    again = ToyTrainer()
    assert search(again) == outcome and again.trained == []
    assert (tmp_path / "best" / "reward.py").read_text() == found_text(found)


class Wavering(ToyTrainer):
    """Numbers other than 7 and 12 have a worth that depends on the seed, so that their race needs all seeds."""

    def result(self, lane: LaneSpec) -> TrainingResult:
        assert isinstance(lane.program, RewardGraph | str)
        if isinstance(lane.program, str) or lane.program.nodes[0].args[0] in (7.0, 12.0):
            return super().result(lane)
        luck = (lane.seed % 2) * 20.0 if lane.seed else 0.0
        return super().result(replace(lane, seed=0, program=_worth(12.5 + luck)))


class Dies(Wavering):
    """Stands for a process that ends when the final trainings of a tuning are to be judged."""

    def evaluate(self, env, policies, *, seed, **options):
        if 1_000_000 < seed < 2_000_000 and any(lane.endswith("-s4") for lane in policies):
            raise SystemExit
        return super().evaluate(env, policies, seed=seed, **options)


def _worth(value: float) -> RewardGraph:
    return RewardGraph(nodes=(Node("full", (value,)),), reward=0, components=())


def test_a_search_that_fits_numbers_compares_what_it_would_without(tmp_path: Path) -> None:
    """The race of the numbers uses other seeds: those with which the original text won the search's race favour it."""

    def search(name: str, tune: int, trainer: ToyTrainer) -> RunView:
        wanted = RunConfig(sample=2, iteration=1, repair=0, refill=0, seeds=3, tune=tune)
        with Store.open(tmp_path / name, wanted) as store, suppress(SystemExit):
            model = ScriptedModel([reply(7.0), reply(12.0)])
            run(wanted, store, model, ToyChecker(), trainer, TOY, strategies.make(wanted))
        return RunView.read(tmp_path / name)

    alone, fitted_too = search("alone", 0, Wavering()), search("fitted", 8, Wavering())
    own = alone.best and alone.best.program
    assert own is not None and len(alone.outcome.method.held_out) == 2
    assert {lane.seed for lane in fitted_too.lanes.values() if lane.role == "final"} == {1, 2, 4, 5, 6}
    assert unused_seed(fitted_too.config) == 7
    assert fitted_too.outcome == alone.outcome and len(fitted_too.tried) == len(alone.tried)
    with Store.view(tmp_path / "fitted") as store:
        assert store.glance().held_out == mean(alone.outcome.method.held_out)
    killed = search("killed", 8, Dies())
    assert not killed.ended and killed.outcome == alone.outcome
    assert of_tuning(killed.tuned) == "Not decided yet: the final trainings are not done."
    assert [command for command, _ in commands(killed)] == ["eureka resume DIR"]


class Settled(ToyTrainer):
    """Numbers other than 7 and 12 are worth 1. With the seeds of a tuning, from 4 on, 7 and 12 are worth 11."""

    def result(self, lane: LaneSpec) -> TrainingResult:
        known = isinstance(lane.program, str) or lane.program.nodes[0].args[0] in (7.0, 12.0)
        if known and lane.seed < 4:
            return super().result(lane)
        return super().result(replace(lane, program=_worth(11.0 if known else 1.0)))


def test_a_search_whose_numbers_stay_keeps_the_policy_that_it_found_and_tried(tmp_path: Path) -> None:
    def search(name: str, tune: int) -> RunView:
        wanted = RunConfig(sample=2, iteration=1, repair=0, refill=0, seeds=3, tune=tune)
        with Store.open(tmp_path / name, wanted) as store:
            model = ScriptedModel([reply(7.0), reply(12.0)])
            run(wanted, store, model, ToyChecker(), Settled(), TOY, strategies.make(wanted))
            assert store.best() is not None and store.best().lane in store.lanes.tryouts()
        return RunView.read(tmp_path / name)

    alone, fitted_too = search("alone", 0), search("fitted", 8)
    assert fitted_too.tuned is not None and fitted_too.tuned.better == ORIGINAL
    assert tables.worlds(fitted_too) == tables.worlds(alone)
    policies = [(tmp_path / name / "best" / "policy.safetensors").read_bytes() for name in ("alone", "fitted")]
    assert policies[0] == policies[1]


def test_a_tuning_that_has_begun_goes_on_with_its_text_whoever_leads_by_then(tmp_path: Path) -> None:
    wanted = RunConfig(sample=2, iteration=1, repair=0, refill=0, seeds=2, tune=8)
    with Store.open(tmp_path, wanted) as store:
        run(wanted, store, ScriptedModel([reply(7.0), reply(8.0)]), ToyChecker(), ToyTrainer(), TOY,
            strategies.make(wanted))  # fmt: skip
        (entries,) = (generation.entries for generation in store.history().generations)
        lanes, began = Lanes(wanted, store, ToyTrainer(), nobody), dict(store.rewards.named())
        other = next(entry for entry in entries if entry.candidate_id != began[ORIGINAL])
        assert tuning.tune_winner(lanes, ToyChecker(), other) is not None
        assert tuning.tune_winner(lanes, ToyChecker(), None) is not None
        assert store.rewards.named() == began


def test_a_search_whose_winner_has_no_number_to_fit_is_finished(tmp_path: Path) -> None:
    wanted = RunConfig(sample=2, iteration=1, repair=0, refill=0, seeds=2, tune=8)
    with Store.open(tmp_path, wanted) as store:
        model = ScriptedModel([PLAIN, PLAIN])
        run(wanted, store, model, ToyChecker(), ToyTrainer(), TOY, strategies.make(wanted))
    assert RunView.read(tmp_path).tuned is None
    assert Run(tmp_path).finished


@pytest.mark.parametrize("search", ["eureka", "openeureka.strategies.strategy:eureka"])
def test_a_tuning_plays_its_lanes_and_a_search_that_ranks_by_training_does_not_take_that_for_its_own(
    tmp_path: Path, search: str
):
    """8 leads in training. Played scores are one less: if those of the tuning counted, 7.5 would come before it."""

    def found(tune: int):
        wanted = RunConfig(sample=2, iteration=1, repair=0, refill=0, seeds=2, tune=tune, search=search)
        texts, strategy = [reply(worth) for worth in (7.5, 8.0)], strategies.make(wanted)
        with Store.open(tmp_path / str(tune), wanted, strategy.ranks) as store:
            run(wanted, store, ScriptedModel(texts), ToyChecker(), ToyTrainer(), TOY, strategy)
        return RunView.read(tmp_path / str(tune))

    alone, fitted_too = found(0), found(8)
    assert fitted_too.tuned is not None and fitted_too.history == alone.history
    assert fitted_too.outcome is not None and alone.outcome is not None
    assert fitted_too.outcome.best == alone.outcome.best and fitted_too.outcome.share == 1.0
    # Original and fitted numbers are judged alike: by the only policy that stands for a lane in this search.
    assert {score.peak for score in fitted_too.evaluations.values()} == {"fitness"}


# --- arithmetic ------------------------------------------------------------------------------------------------------


def test_the_rank_correlation_and_its_interval() -> None:
    # Ranks 1 2 3 4 5 and 2 1 4 3 5: squared differences sum to 4, so 1 - 6 * 4 / (5 * 24) = 0.8.
    found = tuned.correlation([1.0, 2.0, 3.0, 4.0, 50.0], [20.0, 10.0, 40.0, 30.0, 1000.0], claims=1)
    assert found is not None and found.value == pytest.approx(0.8)
    # atanh(0.8) = 1.0986, half = 1.96 * sqrt(1.06 / 2) = 1.4269
    assert (found.low, found.high) == pytest.approx((math.tanh(-0.3283), math.tanh(2.5255)), abs=1e-3)
    assert not found.sure


def test_ties_share_a_rank_and_an_undefined_f_has_the_lowest() -> None:
    falling = tuned.correlation([1.0, 2.0, 3.0, 4.0, 5.0], [3.0, 3.0, 2.0, -math.inf, -math.inf])
    # Ranks 1 2 3 4 5 and 4.5 4.5 3 1.5 1.5: covariance -9, variances 10 and 9, -9 / sqrt(90) = -0.9487
    assert falling is not None and falling.value == pytest.approx(-0.9487, abs=1e-4)
    assert tuned.correlation([1.0, 2.0], [1.0, 2.0]) is None
    assert tuned.correlation([1.0] * 6, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]) is None


def test_the_difference_allows_for_the_best_having_been_picked(tmp_path: Path) -> None:
    found = go(tmp_path, Hill(noise=3.0, error=3.0), spoiled(3), tune=16)
    (rival,) = (own.scores for name, own in found.finals.items() if name not in (ORIGINAL, found.after))
    assert found.difference == tuned.difference(
        found.finals[found.after].scores, found.finals[ORIGINAL].scores, [rival], claims=2 / 0.9
    )
    assert isinstance(found.difference, Difference)


class Hungry(ToyTrainer):
    """A policy of worth w takes a torque of 10 w. In held-out episodes, one worth above 7.2 takes `more` on top."""

    more = 0.0

    def evaluate(self, env, policies, *, seed, **options):
        held_out = 1_000_000 < seed < 2_000_000
        for score in super().evaluate(env, policies, seed=seed, **options):
            worth = float(policies[score.lane])
            yield replace(score, costs={"torque": 10 * worth + (self.more if held_out and worth > 7.2 else 0.0)})


@pytest.mark.parametrize("more", [0.0, 20.0])
def test_numbers_whose_policies_break_a_limit_do_not_win(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: float
) -> None:
    trainer = Hungry()
    trainer.more = more
    wanted = RunConfig(sample=8, iteration=1, repair=0, refill=0, seeds=2, tune=24, limits="torque=75")
    with Store.open(tmp_path, wanted) as store:
        text = f"```python\n{program(7.0).replace('7.0', '7.0 * x')}```\n"
        run(wanted, store, ScriptedModel([text] * 8), ToyChecker(), trainer, TOY, strategies.make(wanted))
    view = RunView.read(tmp_path)
    found, own = view.tuned, view.best
    assert found is not None and own is not None and own.program is not None
    before, after = (max(found.finals[name].scores) for name in (ORIGINAL, found.after))
    assert before < after <= 6.5  # played, a policy scores one less than its worth
    best = (tmp_path / "best" / "reward.py").read_text()
    if more:
        assert found.better == ORIGINAL and "7.0 * x" in best and "break a limit, torque 9" in of_tuning(found)
    else:
        assert found.better == found.after and "7.0 * x" not in best and not found.breach
    assert view.best_text is not None and view.best_text.source == best
    # The search compared and tried the original numbers. If fitted ones won, `best/` holds another reward.
    assert ("before its numbers were fitted" in tables.worlds(view).note) == (not more)
    open_ = Difference(value=0.5, low=-0.5, high=1.5, seeds=9)
    monkeypatch.setattr(Outcome, "difference", property(lambda outcome: open_))
    folder = "best" if more else f"candidates/{own.program.id}"
    ((command, _),) = deciding(view)
    assert f"reward=human,DIR/{folder}/reward.py" in command and (tmp_path / folder / "reward.py").exists()
