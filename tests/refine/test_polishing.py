"""The best policy trains further: from its weights, under the leading rewards. It is compared with what it was."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
from loop.alone import Killed, run

from openeureka import strategies
from openeureka.cli.facts import facts
from openeureka.cli.show import summary
from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.method.lanes import HELD_OUT
from openeureka.refine import polishing
from openeureka.refine.polishing import Polished, Try
from openeureka.report import html, tables
from openeureka.report.next_steps import commands
from openeureka.report.verdict import of_polishing, verdict
from openeureka.report.view import RunView
from openeureka.runs.run import Run
from openeureka.score import Outcome, gain
from openeureka.store import Store
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, reply
from openeureka.types import (
    Evaluation,
    Lane,
    LaneSpec,
    Node,
    PolicyId,
    RewardGraph,
    Start,
    TrainBudget,
    TrainingResult,
    TrainingState,
)
from openeureka.ui import pages


@dataclass
class Runner(ToyTrainer):
    """A training that starts from a policy gains `gained` over it, less 1 for each tenth of fresh weights."""

    gained: float = 4.0
    failing: Sequence[str] = field(default_factory=list)
    specs: dict[str, LaneSpec] = field(default_factory=dict)
    steps: list[int] = field(default_factory=list)

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget):
        self.steps.append(budget.env_steps)
        yield from super().train(env, lanes, budget)

    def result(self, lane: LaneSpec) -> TrainingResult:
        self.specs[lane.id] = lane
        if lane.id in self.failing:
            return TrainingResult(
                lane=lane.id, state=TrainingState.DIVERGED, fitness=None, curves={}, env_steps=1, seconds=0.0
            )
        if lane.start is not None:
            worth = float(lane.start) + self.gained - 10.0 * lane.fresh
            graph = RewardGraph(nodes=(Node("full", (worth,)),), reward=0, components=())
            lane = replace(lane, program=graph, seed=0, start=None)
        return replace(super().result(lane), env_steps=800)


def config(**settings) -> RunConfig:
    return RunConfig(**{"sample": 2, "iteration": 1, "repair": 0, "refill": 0, "seeds": 2, "polish": 3} | settings)


def search(directory: Path, trainer: ToyTrainer, worths: Sequence[float] = (7.0, 8.0), **settings) -> Outcome:
    wanted = config(**settings)
    with Store.open(directory, wanted) as store:
        model = ScriptedModel([reply(worth) for worth in worths], said=len(store.talk.replies()))
        return run(wanted, store, model, ToyChecker(), trainer, TOY, strategies.make(wanted))


def polished(directory: Path) -> Polished:
    found = RunView.read(directory).polished
    assert found is not None
    return found


def test_lanes_go_on_from_the_policy_in_best_with_different_shares(tmp_path: Path) -> None:
    trainer = Runner()
    outcome = search(tmp_path, trainer)
    assert outcome.best is not None
    own, policy = outcome.best.candidate_id, (tmp_path / "best" / "policy.safetensors").read_bytes()
    assert policy == b"8.02"  # the better of seeds 1 and 2
    carried = {name: trainer.specs[name] for name in (f"{own}-s3", f"{own}-s4", f"{own}-s5")}
    assert [(spec.start, spec.fresh, spec.rescaled) for spec in carried.values()] == [
        *((policy, 0.0, False), (policy, 0.1, False), (policy, 0.25, False))
    ]
    found = polished(tmp_path)
    assert [one.lane.id for one in found.tries] == list(carried)
    assert {one.lane.role for one in found.tries} == {"polish"}
    assert found.began == PolicyId(f"{own}-s2", "reward")
    assert trainer.steps[-1] == 100  # an eighth of 800


def test_what_is_better_stands_in_polished_and_best_stays_what_it_was(tmp_path: Path) -> None:
    plain, carried = tmp_path / "plain", tmp_path / "carried"
    outcome, other = search(plain, Runner(error=0.1), polish=0), search(carried, Runner(error=0.1))
    assert other == outcome  # polishing leaves the comparison of rewards alone
    for name in ("reward.py", "policy.safetensors"):
        assert (carried / "best" / name).read_bytes() == (plain / "best" / name).read_bytes()
    assert (carried / "polished" / "policy.safetensors").read_bytes() == b"12.02"
    found = polished(carried)
    assert found.better and found.best is not None and found.best.lane.endswith("-s3")
    # Played and held out are one less than in training; 1.96 * sqrt(0.1**2 + 0.1**2) = 0.277.
    assert found.gain is not None and (found.gain.value, found.gain.low) == pytest.approx((4.0, 3.723), abs=1e-3)
    between = "F 11.02 ± 0.10 against 7.02 ± 0.10 of the policy it started from, held out"
    assert of_polishing(found).startswith(f"The policy that trained further is better: {between}; ")
    assert not (plain / "polished").exists() and RunView.read(plain).polished is None


def test_both_policies_are_compared_in_episodes_by_which_neither_was_chosen(tmp_path: Path) -> None:
    class Lucky(Runner):
        """In held-out episodes F is higher by luck: by the number of the training's seed."""

        def evaluate(self, env, policies, *, seed, **options):
            for score in super().evaluate(env, policies, seed=seed, **options):
                luck = float(score.lane[-1]) if seed == HELD_OUT and score.lane[-1].isdigit() else 0.0
                yield replace(score, fitness=(score.fitness or 0.0) + luck)

    outcome = search(tmp_path, Lucky(gained=0.5))
    assert outcome.method.held_out == pytest.approx((8.01, 9.02))
    found = polished(tmp_path)
    # The policy of seed 2 is in best/. In episodes without luck it scores 7.02.
    assert found.before is not None and found.before.fitness == pytest.approx(7.02)
    assert found.gain is not None and found.gain.value == pytest.approx(0.5) and found.better


def test_the_score_that_the_policy_was_chosen_by_does_not_stand_for_one_to_compare_by(tmp_path: Path) -> None:
    search(tmp_path, Runner())
    view = RunView.read(tmp_path)
    assert view.polished is not None and "noise" not in tables.polished(view, view.polished).note
    noisy = {lane: replace(score, noisy=True) for lane, score in view.evaluations.items()}
    assert "keep the noise of training" in tables.polished(replace(view, evaluations=noisy), view.polished).note
    found = replace(view, tryouts={}).polished  # as before the two are compared
    assert found is not None and found.before is None


def test_a_policy_that_loses_by_it_stays_the_best(tmp_path: Path) -> None:
    search(tmp_path, Runner(gained=-2.0, error=0.1))
    found = polished(tmp_path)
    assert not found.better and found.best == found.began
    assert found.chosen is not None and found.chosen.start.fresh == 0.0  # the best of three that lost
    assert of_polishing(found).startswith("The policy that trained further is worse: F 5.02 ± 0.10 against 7.02 ± 0.10")
    assert not (tmp_path / "polished").exists()


def test_a_lane_too_short_for_an_episode_plays_all_the_same(tmp_path: Path) -> None:
    class Short(Runner):
        def result(self, lane: LaneSpec) -> TrainingResult:
            found = super().result(lane)
            return found if lane.start is None else replace(found, fitness=None, best_fitness=None)

    search(tmp_path, Short())
    found = polished(tmp_path)
    assert found.better and found.after is not None and found.after.fitness == pytest.approx(11.02)


def test_the_other_rewards_that_raced_carry_it_on_too(tmp_path: Path) -> None:
    trainer = Runner(error=0.6)
    outcome = search(tmp_path, trainer, polish=5)
    # After two looks each they are 1 apart, within two standard errors: 2 * sqrt(2 * 0.6**2 / 2) = 1.2.
    assert outcome.best is not None and len(outcome.rivals) == 1
    own = outcome.best.candidate_id
    tries = polished(tmp_path).tries
    assert [(one.lane.reward == own, one.start.fresh) for one in tries] == [
        *((True, 0.0), (True, 0.1), (False, 0.0), (True, 0.25), (False, 0.1))
    ]
    for one in tries:
        assert trainer.specs[one.lane.id].rescaled == (one.lane.reward != own)
    assert len({one.lane.seed for one in tries} | {0, 1, 2}) == 8  # no seed is used twice


def test_more_lanes_than_ways_come_again_with_further_seeds() -> None:
    graph = RewardGraph(nodes=(Node("full", (1.0,)),), reward=0, components=())
    dealt = [lane for lane, _ in polishing.deal(config(polish=6), PolicyId("a-s1", "last"), {"a": graph})]
    assert [lane.start.fresh for lane in dealt if lane.start] == [0.0, 0.1, 0.25, 0.5, 0.0, 0.1]
    assert [lane.seed for lane in dealt] == [3, 4, 5, 6, 7, 8]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], Polished]:
    """Lanes of a search that nobody stops, and what it polished."""
    folder, trainer = tmp_path_factory.mktemp("whole"), Runner()
    search(folder, trainer)
    return trainer.trained, polished(folder)


@pytest.mark.parametrize("after", [6, 8, 10])
def test_a_stopped_one_goes_on_and_trains_nothing_twice(
    whole: tuple[list[str], Polished], tmp_path: Path, after: int
) -> None:
    @dataclass
    class Stopping(Runner):
        def result(self, lane: LaneSpec) -> TrainingResult:
            if len(self.trained) > after:
                raise KeyboardInterrupt
            return super().result(lane)

    first, second, third = Stopping(), Runner(), Runner()
    with pytest.raises(KeyboardInterrupt):
        search(tmp_path / "run", first)
    assert not Run(tmp_path / "run").finished
    search(tmp_path / "run", second)
    assert ([*first.trained[:-1], *second.trained], polished(tmp_path / "run")) == whole
    assert Run(tmp_path / "run").finished
    search(tmp_path / "run", third)
    assert third.trained == []


def test_where_no_lane_leaves_a_policy_the_best_stays(tmp_path: Path) -> None:
    trainer = Runner()
    outcome = search(tmp_path / "a", trainer)
    assert outcome.best is not None
    own = outcome.best.candidate_id
    search(tmp_path / "b", Runner(failing=[f"{own}-s{seed}" for seed in (3, 4, 5)]))
    found = polished(tmp_path / "b")
    assert found.chosen is None and not found.better
    assert of_polishing(found).startswith("Further training left no policy that could be scored: the one in best/")
    assert Run(tmp_path / "b").finished


def test_a_search_that_found_nothing_is_finished_without_it(tmp_path: Path) -> None:
    wanted = config(sample=1, baselines="known", env="cartpole")
    with Store.open(tmp_path, wanted) as store:
        run(wanted, store, ScriptedModel(["no code"]), ToyChecker(), Runner(), TOY, strategies.make(wanted))
    assert RunView.read(tmp_path).polished is None and Run(tmp_path).finished


def test_after_a_tuning_the_policy_of_the_better_numbers_is_carried_on(tmp_path: Path) -> None:
    def text(worth: float) -> str:
        return reply(worth).replace(str(worth), f"{worth} * x")

    wanted = config(tune=8, polish=2)
    with Store.open(tmp_path, wanted) as store:
        model, trainer = ScriptedModel([text(7.0), text(8.0)]), Runner()
        run(wanted, store, model, ToyChecker(), trainer, TOY, strategies.make(wanted))
    view = RunView.read(tmp_path)
    found, tuned = view.polished, view.tuned
    assert found is not None and tuned is not None and found.began.lane.startswith(view.texts[tuned.better].id)
    assert trainer.specs[found.tries[0].lane.id].start == (tmp_path / "best" / "policy.safetensors").read_bytes()
    assert Run(tmp_path).finished


def test_reports_name_both_results_and_keep_them_apart(tmp_path: Path) -> None:
    search(tmp_path, Runner(error=0.1))
    view = RunView.read(tmp_path)
    found = polished(tmp_path)
    assert "trained further" not in verdict(view)
    shown = "\n".join(summary(view)), html.report(view, tmp_path), str(pages.overview(tmp_path, view))
    for text in shown:
        assert "The best policy, trained further" in text and of_polishing(found) in text and verdict(view) in text
        assert found.tries[1].lane.id in text and "10%" in text
    assert "<code>polished/</code> holds the result" in shown[1]
    assert ("eureka play DIR policy=polished", "watch the best policy") in commands(view)
    told = json.loads(json.dumps(facts(view)))["polished"]
    assert told["better"] and told["best"]["lane"] == found.tries[0].lane.id
    assert [lane["fresh"] for lane in told["lanes"]] == [0.0, 0.1, 0.25]
    assert Run(tmp_path).polished == found


def test_lanes_come_back_from_the_store_with_what_they_began_from(tmp_path: Path) -> None:
    start = Start(PolicyId("a-s1", "fitness"), 0.25)
    with Store.open(tmp_path, config()) as store:
        store.lanes.add([Lane("a", 7, "polish", start), Lane("a", 1, "final")])
        assert [lane.start for lane in store.lanes.all().values()] == [start, None]


def test_a_gain_without_errors_has_no_interval() -> None:
    one = Evaluation(lane="a", fitness=3.0, episode_length=1.0, episodes=4)
    found = gain(one, replace(one, fitness=1.0, episodes=2))
    assert found is not None and (found.value, found.low, found.count, found.sure) == (2.0, None, 2, False)
    assert gain(one, replace(one, fitness=None)) is None
    began, start = PolicyId("b-s0", "last"), Start(PolicyId("b-s0", "last"), 0.0)
    tried = Try(lane=Lane("a", 1, "polish", start), start=start, result=None, played=one)
    told = Polished(tries=(tried,), began=began, before=replace(one, fitness=1.0), chosen=tried, after=one, best=began)
    assert of_polishing(told) == "Not decided: F 3 against 1 of the policy it started from, held out."
    lost = replace(told, before=replace(one, fitness=None))
    assert of_polishing(lost) == "Not decided: F 3 against - of the policy it started from, held out."


def test_settings_that_make_no_sense_are_refused() -> None:
    with pytest.raises(ConfigError, match="`polish_steps` has no effect without `polish`"):
        RunConfig(polish_steps=1000)
    with pytest.raises(ConfigError, match="`polish` must be from 0"):
        RunConfig(polish=-1)


def test_a_policy_that_breaks_a_limit_is_not_handed_over(tmp_path: Path) -> None:
    class Costly(Runner):
        def evaluate(self, env, policies, *, seed, **options):
            for score in super().evaluate(env, policies, seed=seed, **options):
                yield replace(score, costs={"torque": 10 * float(policies[score.lane])})

    search(tmp_path, Costly(), worths=(7.0, 5.0), limits="torque=75")
    found = polished(tmp_path)
    assert found.after is not None and found.after.fitness is not None and found.before is not None
    assert found.after.fitness > (found.before.fitness or 0.0)  # F is higher, but the torque is above 100
    assert not found.better and not (tmp_path / "polished").exists()
    assert "breaks a limit, torque" in of_polishing(found) and not found.breach_before
    view = RunView.read(tmp_path)
    stricter = replace(view, config=replace(view.config, limits="torque=65")).polished
    assert stricter is not None and stricter.breach_before == "torque 70.2 N m, above 65"
    both = replace(stricter, best=PolicyId("other-s0", "last"), breach="torque 78 N m, above 65")
    assert "wins" not in of_polishing(both)
    assert of_polishing(both).endswith("Both break a limit: torque 78 N m, above 65.")
    wins = replace(stricter, breach="", best=PolicyId("other-s0", "last"))  # a lane of lower torque
    assert of_polishing(wins).startswith("The policy that trained further wins: the one before breaks a limit, torque ")


@dataclass
class Dying(ToyTrainer):
    """Dies at its `left`-th event. In held-out episodes, every policy breaks the limit."""

    left: int = 1_000

    def train(self, env, lanes, budget):
        for result in super().train(env, lanes, budget):
            self.left -= 1
            if not self.left:
                raise Killed
            yield result

    def evaluate(self, env, policies, *, seed, **options):
        self.left -= 1
        if not self.left:
            raise Killed
        torque = 80.0 if 1_000_000 < seed < 2_000_000 else 50.0
        for score in super().evaluate(env, policies, seed=seed, **options):
            yield replace(score, costs={"torque": torque})


def tuned_and_polished(directory: Path, trainer: Dying) -> Polished:
    wanted = config(tune=4, polish=2, limits="torque=75")
    texts = [reply(worth).replace(str(worth), f"{worth} * x") for worth in (7.0, 7.1)]
    with Store.open(directory, wanted) as store:
        model = ScriptedModel(texts, said=len(store.talk.replies()))
        run(wanted, store, model, ToyChecker(), trainer, TOY, strategies.make(wanted))
    return polished(directory)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Polished:
    return tuned_and_polished(tmp_path_factory.mktemp("undisturbed"), Dying())


@pytest.mark.parametrize("calls", range(1, 30))
def test_a_kill_before_or_in_a_polishing_that_follows_a_tuning_changes_nothing(
    undisturbed: Polished, tmp_path: Path, calls: int
) -> None:
    """The policy that trains further is the one that won the search's race."""
    assert len(undisturbed.tries) == 2 and undisturbed.best is not None
    with suppress(Killed):
        tuned_and_polished(tmp_path, Dying(left=calls))
    assert tuned_and_polished(tmp_path, Dying()) == undisturbed
