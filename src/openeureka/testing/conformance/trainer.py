"""What every trainer must do. Inherit, make the trainer, and let pytest collect it:

class TestMyTrainer(TrainerConformance):
    env = "cartpole"
    budget = TrainBudget(env_steps=2048, worlds=16)

    def make(self) -> Trainer:
        return MyTrainer()
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

from openeureka.types import (
    Dynamics,
    Evaluation,
    LaneSpec,
    RewardProgram,
    TrainBudget,
    Trainer,
    TrainingEvent,
    TrainingProgress,
    TrainingResult,
    TrainingState,
)


class TrainerConformance:
    """Checks that hold for any trainer; how well it learns is a matter for its own tests.

    Attributes:
        env: task to train.
        budget: small, but enough for a few epochs.
        programs: rewards to train side by side.
        episodes: number of them in each evaluation.
    """

    env: ClassVar[str]
    budget: ClassVar[TrainBudget] = TrainBudget()
    programs: ClassVar[tuple[RewardProgram, ...]] = ("human", "sparse")
    episodes: ClassVar[int] = 16

    _kept: ClassVar[list[TrainingEvent]]
    _scored: ClassVar[list[Evaluation]]

    def make(self) -> Trainer:
        raise NotImplementedError

    def lanes(self) -> list[LaneSpec]:
        return [
            LaneSpec(id=f"p{number}-s{seed}", program=program, seed=seed)
            for number, program in enumerate(self.programs)
            for seed in (0, 1)
        ]

    def test_each_lane_has_exactly_one_result(self) -> None:
        assert sorted(result.lane for result in self._results()) == sorted(lane.id for lane in self.lanes())

    def test_progress_counts_epochs_and_names_lanes(self) -> None:
        known = {lane.id for lane in self.lanes()}
        for event in self._events():
            if isinstance(event, TrainingProgress):
                assert 0 <= event.epoch <= event.epochs
                assert set(event.fitness) <= known

    def test_fitness_is_the_highest_of_its_curve(self) -> None:
        for result in self._finished():
            defined = [value for value in result.curves["fitness"] if value is not None]
            assert result.fitness == (max(defined) if defined else None)
            assert result.best_fitness is None or result.best_fitness.value == result.fitness

    def test_curves_have_a_value_or_none_for_each_epoch(self) -> None:
        for result in self._finished():
            assert {"fitness", "episode_length", "reward", "human_reward"} <= set(result.curves)
            assert len({len(curve) for curve in result.curves.values()}) == 1
            values = [value for curve in result.curves.values() for value in curve if value is not None]
            assert values and all(map(math.isfinite, values))

    def test_the_human_reward_correlates_with_itself(self) -> None:
        names = [f"p{number}-" for number, program in enumerate(self.programs) if program == "human"]
        for result in self._finished():
            assert result.correlation is None or -1 - 1e-6 <= result.correlation <= 1 + 1e-6
            if result.lane.startswith(tuple(names)):
                assert result.correlation is None or abs(result.correlation - 1) < 1e-3

    def test_the_same_lanes_give_the_same_results(self) -> None:
        second = self._trained(self.lanes(), self.budget)
        for first in self._results():
            assert first.state == second[first.lane].state
            assert first.fitness == second[first.lane].fitness
            assert first.curves == second[first.lane].curves

    def test_lanes_that_paused_go_on_to_the_same_end(self) -> None:
        lanes, half = self.lanes()[:2], replace(self.budget, until=0.5)
        paused = self._trained(lanes, half)
        assert {result.state for result in paused.values()} == {TrainingState.PAUSED}
        ended = self._trained([replace(lane, paused=paused[lane.id].paused) for lane in lanes], self.budget)
        for whole in (result for result in self._finished() if result.lane in ended):
            assert ended[whole.lane].state is TrainingState.FINISHED
            assert ended[whole.lane].env_steps == whole.env_steps
            for mine, theirs in zip(ended[whole.lane].curves["reward"], whole.curves["reward"], strict=True):
                assert mine is not None and theirs is not None and math.isclose(mine, theirs, rel_tol=1e-2)

    def test_progress_pays_nothing_to_rewards_that_tell_none(self) -> None:
        second = self._trained(self.lanes(), replace(self.budget, bonus="progress"))
        own = {lane.id for lane in self.lanes() if isinstance(lane.program, str)}
        for first in (result for result in self._results() if result.lane in own):
            assert first.curves == second[first.lane].curves

    def test_a_lane_that_starts_from_a_policy_acts_as_that_does(self) -> None:
        (policy,) = (result.last for result in self._finished()[:1])
        assert policy is not None
        one = replace(self.budget, env_steps=1)
        lanes = [
            LaneSpec(id="own", program="sparse", start=policy, rescaled=True),
            LaneSpec(id="fresh", program="sparse", start=policy, rescaled=True, fresh=1.0),
        ]
        acted = _peaks(self._trained(lanes, one).values())
        scores = {s.lane: s for s in self._scores({"start": policy, **acted})}
        assert set(scores) == {"start", "own", "fresh"}
        assert math.isclose(scores["own"].episode_length, scores["start"].episode_length, rel_tol=0.05)
        assert acted["fresh"] != acted["own"]

    def test_policies_are_scored_one_by_one(self) -> None:
        policies, scores = self._played(), self._plain()
        assert policies
        assert sorted(score.lane for score in scores) == sorted(policies)
        assert all(score.episodes > 0 and score.episode_length > 0 for score in scores)
        assert self._scores(policies) == scores

    def test_a_changed_world_leaves_the_tasks_own_beside_it_alone(self) -> None:
        policy = next(iter(_peaks(self._finished()).values()))
        policies, heavy = {"own": policy, "heavy": policy}, {"heavy": Dynamics(mass=1.1)}
        scores = {s.lane: s for s in self._scores(policies, dynamics=heavy)}
        assert set(scores) == {"own", "heavy"}
        (alone,) = self._scores({"own": policy})
        assert scores["own"].episodes == alone.episodes
        assert math.isclose(scores["own"].episode_length, alone.episode_length, rel_tol=0.05)

    def test_what_is_untrained_plays_as_its_seed_begins(self) -> None:
        policies = self._played()
        one, other = self._scores(policies, untrained=dict.fromkeys(policies, 5))
        assert (one.lane, other.lane) == tuple(policies) and one.episodes == other.episodes
        assert math.isclose(one.episode_length, other.episode_length, rel_tol=0.05)
        scores = [score.fitness or 0.0 for score in (one, other)]
        assert math.isclose(*scores, rel_tol=0.05)

    def test_recorded_episodes_come_with_an_unchanged_score(self) -> None:
        policies, plain, trainer = self._played(), self._plain(), self.make()
        first = next(iter(policies))
        scores = {s.lane: s for s in self._scores(policies, trainer, record=[first])}
        assert [scores[score.lane] for score in plain] == plain
        assert {lane for lane, score in scores.items() if score.recorded is not None} == {first}
        recorded = scores[first].recorded
        assert recorded is not None and recorded.states
        assert len(recorded.fitness) == len(recorded.steps) and set(recorded.owners) <= set(range(len(recorded.steps)))
        assert all(steps > 0 for steps in recorded.steps)
        assert not trainer.rewards(self.env, {}, [recorded])

    def test_nothing_to_do_is_done_at_once(self) -> None:
        assert list(self.make().evaluate(self.env, {}, seed=0)) == []

    def _trained(self, lanes: Sequence[LaneSpec], budget: TrainBudget) -> dict[str, TrainingResult]:
        events = self.make().train(self.env, lanes, budget)
        return {event.lane: event for event in events if isinstance(event, TrainingResult)}

    def _scores(
        self, policies: Mapping[str, bytes], trainer: Trainer | None = None, **options: Any
    ) -> list[Evaluation]:
        playing = trainer or self.make()
        return list(playing.evaluate(self.env, policies, seed=7, episodes=self.episodes, **options))

    def _played(self) -> dict[str, bytes]:
        return _peaks(self._finished()[:2])

    def _plain(self) -> list[Evaluation]:
        """Scores of the policies of `_played`, computed once for all checks of the class."""
        kind = type(self)
        if "_scored" not in kind.__dict__:
            kind._scored = self._scores(self._played())
        return kind._scored

    def _events(self) -> list[TrainingEvent]:
        """Events of one training, run once for all checks of the class: it may take seconds."""
        kind = type(self)
        if "_kept" not in kind.__dict__:
            kind._kept = list(self.make().train(self.env, self.lanes(), self.budget))
        return kind._kept

    def _results(self) -> list[TrainingResult]:
        return [event for event in self._events() if isinstance(event, TrainingResult)]

    def _finished(self) -> list[TrainingResult]:
        finished = [result for result in self._results() if result.state is TrainingState.FINISHED]
        assert finished, "a trainer must be able to finish training with the human and the sparse reward"
        return finished


def _peaks(results: Iterable[TrainingResult]) -> dict[str, bytes]:
    """The policies in which the rewards of lanes were highest, by lane."""
    return {result.lane: result.best_reward.policy for result in results if result.best_reward is not None}
