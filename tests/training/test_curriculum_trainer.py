"""Lanes take their policy from stage to stage, and the results of each stage are kept."""

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest
import torch

from openeureka.errors import StoreError
from openeureka.executors.local import LocalExecutor
from openeureka.store import StageFiles
from openeureka.tasks import curriculum
from openeureka.tasks.task import Stage
from openeureka.testing.conformance.trainer import TrainerConformance
from openeureka.testing.scripted import ToyTrainer
from openeureka.training import episodes
from openeureka.training.curriculum import CurriculumTrainer
from openeureka.training.evaluate import evaluate
from openeureka.training.policy import Policy
from openeureka.training.population import Population
from openeureka.types import (
    Episodes,
    Evaluation,
    LaneSpec,
    RewardGraph,
    TrainBudget,
    TrainingEvent,
    TrainingProgress,
    TrainingResult,
    TrainingState,
)

STAGES = (Stage(env="easy", steps=300), Stage(env="hard", steps=100))
SPECS = [LaneSpec(id="human-s0", program="human"), LaneSpec(id="sparse-s0", program="sparse")]


@dataclass
class StagedTrainer(ToyTrainer):
    """A ToyTrainer that records its requests. Lanes end in the state that `states` gives for their task and spec."""

    asked: list[tuple[str, int, dict[str, bytes | None]]] = field(default_factory=list)
    states: dict[tuple[str, str], TrainingState] = field(default_factory=dict)

    def train(
        self, env: str, specs: Sequence[LaneSpec], budget: TrainBudget
    ) -> Iterator[TrainingProgress | TrainingResult]:
        self.asked.append((env, budget.env_steps, {spec.id: spec.start for spec in specs}))
        for event in super().train(env, specs, budget):
            if isinstance(event, TrainingResult) and (state := self.states.get((env, event.lane))):
                event = replace(event, state=state, message="why", last=None)
            if isinstance(event, TrainingResult):
                event = replace(event, seconds=4.0, clock=(1.0, 2.0, 3.0))
            else:
                latest = {spec.id: {"reward": 2.0, "fitness": 7.0} for spec in specs}
                event = replace(event, fitness={spec.id: 7.0 for spec in specs}, latest=latest)
            yield event


def go(trainer: StagedTrainer, folder: Path, *, env_steps: int = 0):
    """Events of both specs through both stages."""
    staged = CurriculumTrainer(trainer, STAGES, StageFiles(folder))
    return list(staged.train("hard", SPECS, TrainBudget(env_steps=env_steps)))


def results(events) -> dict[str, TrainingResult]:
    return {event.lane: event for event in events if isinstance(event, TrainingResult)}


def test_all_lanes_go_on_from_their_own_last_policy(tmp_path: Path):
    trainer = StagedTrainer()
    found = results(go(trainer, tmp_path))
    # ToyTrainer: the human reward has an F of 10, the sparse one of 5, and a policy is its F as text.
    assert trainer.asked == [
        ("easy", 300, {"human-s0": None, "sparse-s0": None}),
        ("hard", 100, {"human-s0": b"10.0", "sparse-s0": b"5.0"}),
    ]
    assert found["human-s0"].fitness == 10.0
    assert (found["human-s0"].env_steps, found["human-s0"].steps_before) == (6, 3), "three steps in each stage"
    # The first stage took four seconds.
    assert (found["human-s0"].seconds, found["human-s0"].clock) == (8.0, (5.0, 6.0, 7.0))


def test_the_steps_that_are_asked_for_are_shared_out_in_proportion(tmp_path: Path):
    trainer = StagedTrainer()
    go(trainer, tmp_path, env_steps=1000)
    assert [steps for _, steps, _ in trainer.asked] == [750, 250]


def test_progress_counts_through_all_stages_and_only_the_last_tells_f(tmp_path: Path):
    trainer = StagedTrainer()
    events = [event for event in go(trainer, tmp_path) if isinstance(event, TrainingProgress)]
    # ToyTrainer is in epoch 1 of 2. Stage 1 has 3/4 of the steps: 2 of 2.67 epochs; stage 2 the last quarter of 8.
    assert [(event.epoch, event.epochs) for event in events] == [(1, 3), (7, 8)]
    # F of an earlier stage belongs to another task, so neither `fitness` nor `latest` shows it.
    assert [event.fitness["human-s0"] for event in events] == [None, 7.0]
    assert [event.latest["human-s0"] for event in events] == [{"reward": 2.0}, {"reward": 2.0, "fitness": 7.0}]


@pytest.mark.parametrize("state", [TrainingState.DIVERGED, TrainingState.FAILED])
def test_a_lane_that_ends_early_has_no_fitness_and_the_others_go_on(tmp_path: Path, state: TrainingState):
    trainer = StagedTrainer(states={("easy", "human-s0"): state})
    found = results(go(trainer, tmp_path))
    assert trainer.asked[1] == ("hard", 100, {"sparse-s0": b"5.0"})
    lost = found["human-s0"]
    assert (lost.state, lost.fitness, lost.best_fitness, lost.best_reward) == (state, None, None, None)
    assert lost.curves["fitness"] == (None, None, None)
    assert lost.message == "Stage 1: why"
    assert found["sparse-s0"].fitness == 5.0


def test_nothing_is_trained_in_the_last_stage_when_no_lane_reaches_it(tmp_path: Path):
    trainer = StagedTrainer(states={("easy", spec.id): TrainingState.DIVERGED for spec in SPECS})
    assert results(go(trainer, tmp_path)).keys() == {"human-s0", "sparse-s0"}
    assert [env for env, _, _ in trainer.asked] == ["easy"]


def test_a_finished_stage_is_not_repeated_and_one_that_failed_is(tmp_path: Path):
    go(StagedTrainer(states={("easy", "human-s0"): TrainingState.FAILED}), tmp_path)
    again = StagedTrainer()
    found = results(go(again, tmp_path))
    assert again.asked == [
        ("easy", 300, {"human-s0": None}),
        ("hard", 100, {"human-s0": b"10.0", "sparse-s0": b"5.0"}),
    ]
    assert found["sparse-s0"].env_steps == 6


class Stopped(StagedTrainer):
    """Records its end. Yields a stage's results even when stopped, as workers do whose training has ended."""

    def train(
        self, env: str, specs: Sequence[LaneSpec], budget: TrainBudget
    ) -> Iterator[TrainingProgress | TrainingResult]:
        events = list(super().train(env, specs, budget))
        try:
            yield events.pop(0)
            yield from events
        except KeyboardInterrupt:
            yield from events
            raise
        finally:
            self.asked.append((f"{env} ended", 0, {}))


@pytest.mark.parametrize("stage", [1, 2])
def test_results_that_had_come_when_a_stage_was_stopped_are_kept(tmp_path: Path, stage: int):
    trainer, files = Stopped(), StageFiles(tmp_path)
    events = CurriculumTrainer(trainer, STAGES, files).train("hard", SPECS, TrainBudget())
    assert isinstance(events, Generator)
    for _ in range(stage):
        next(events)  # the progress of each stage; results of the first stage are not yielded
    late: list[TrainingProgress | TrainingResult] = []
    with pytest.raises(KeyboardInterrupt):
        late.append(events.throw(KeyboardInterrupt()))
        late += events
    assert [files.read(1, spec.id) is not None for spec in SPECS] == [True, True]
    assert {lane: result.env_steps for lane, result in results(late).items()} == (
        {"human-s0": 6, "sparse-s0": 6} if stage == 2 else {}
    )
    assert trainer.asked[-1][0] == ("easy ended" if stage == 1 else "hard ended")


def test_who_trains_a_stage_that_cannot_be_kept_is_closed_at_once(tmp_path: Path):
    class Full(StageFiles):
        def save(self, stage: int, result: TrainingResult) -> None:
            raise StoreError("The disk is full.")

    trainer = Stopped()
    with pytest.raises(StoreError) as kept:
        list(CurriculumTrainer(trainer, STAGES, Full(tmp_path)).train("hard", SPECS, TrainBudget()))
    assert trainer.asked[-1][0] == "easy ended" and kept.tb is not None


class Forgetful:
    """Keeps no stage, because the suite trains different specs under the same names."""

    def read(self, stage: int, spec: str) -> None: ...
    def save(self, stage: int, result: TrainingResult) -> None: ...


class Here:
    """Trains in this process. `test_pen_spinning_runs_from_end_to_end` trains stages in other processes."""

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Iterator[TrainingEvent]:
        return Population(env, lanes, budget, threads=1).train()

    def evaluate(self, env: str, policies: Mapping[str, bytes], **how: Any) -> Iterator[Evaluation]:
        yield from evaluate(env, policies, threads=1, **how)

    def rewards(
        self, env: str, programs: Mapping[str, RewardGraph], recorded: Sequence[Episodes]
    ) -> Mapping[str, Sequence[float]]:
        return dict(episodes.rewards(env, programs, recorded))


class TestCurriculumTrainer(TrainerConformance):
    """Two short stages of Cartpole with short episodes."""

    env = "cartpole+episode_length=50"
    budget = TrainBudget(env_steps=2048, worlds=16)

    def make(self) -> CurriculumTrainer:
        stages = (Stage(env="cartpole+episode_length=20", steps=1), Stage(env=self.env, steps=1))
        return CurriculumTrainer(Here(), stages, Forgetful())


def test_a_warm_start_is_the_policy_with_its_statistics():
    budget = TrainBudget(env_steps=16 * 32 * 2, worlds=32)
    first = Population("cartpole", [LaneSpec(id="a", program="human", seed=1)], budget, threads=1)
    (before,) = results(first.train()).values()
    policy = before.last
    assert policy is not None
    specs = [LaneSpec(id="warm", program="human", start=policy), LaneSpec(id="cold", program="human")]
    after = Population("cartpole", specs, budget, threads=1)
    warm, cold = (Policy.of("cartpole", after.ppo, lane, after.interface) for lane in (0, 1))
    assert warm.to_bytes() == policy
    assert not torch.equal(cold.tensors["w0"], warm.tensors["w0"])
    # The statistics begin with one sample; two epochs of 16 steps of 32 worlds follow.
    counts = [policy.tensors[f"{name}_count"].item() for policy in (warm, cold) for name in ("observation", "value")]
    assert counts == [1025.0, 1025.0, 1.0, 1.0]


def test_lanes_that_go_on_from_policies_train_the_task_alone(tmp_path: Path):
    trainer = StagedTrainer()
    specs = [replace(spec, start=b"7") for spec in SPECS]
    found = results(
        CurriculumTrainer(trainer, STAGES, StageFiles(tmp_path)).train("hard", specs, TrainBudget(env_steps=40))
    )
    assert trainer.asked == [("hard", 40, {"human-s0": b"7", "sparse-s0": b"7"})]
    assert found.keys() == {"human-s0", "sparse-s0"}


def test_a_start_mixed_with_fresh_weights_keeps_what_it_knows_of_returns():
    budget = TrainBudget(env_steps=16 * 32 * 2, worlds=32)
    first = Population("cartpole", [LaneSpec(id="a", program="human", seed=1)], budget, threads=1)
    policy = next(iter(results(first.train()).values())).last
    assert policy is not None
    specs = [
        LaneSpec(id="mixed", program="human", seed=2, start=policy, fresh=0.25),
        LaneSpec(id="cold", program="human", seed=2),
        LaneSpec(id="other", program="sparse", seed=2, start=policy, rescaled=True),
    ]
    after = Population("cartpole", specs, budget, threads=1)
    mixed, cold, other = (Policy.of("cartpole", after.ppo, lane).tensors for lane in range(3))
    began = Policy.from_bytes(policy).tensors
    for name in ("w0", "b0", "log_std"):
        torch.testing.assert_close(mixed[name], 0.75 * began[name] + 0.25 * cold[name])
    assert began["log_std"].abs().max() > 0 and cold["log_std"].abs().max() == 0  # towards a standard deviation of 1
    for name in ("head_w", "head_b"):
        torch.testing.assert_close(mixed[name][..., -1], began[name][..., -1])
        torch.testing.assert_close(mixed[name][..., :-1], 0.75 * began[name][..., :-1] + 0.25 * cold[name][..., :-1])
    for name in ("observation_mean", "observation_count", "value_mean", "value_count"):
        assert torch.equal(mixed[name], began[name])
    assert torch.equal(other["w0"], began["w0"]) and torch.equal(other["observation_var"], began["observation_var"])
    assert [other[f"value_{part}"].item() for part in ("mean", "var", "count")] == [0.0, 1.0, 1.0]


@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(b"7")])
def test_a_stage_whose_policy_is_gone_or_another_is_trained_again(tmp_path: Path, damage: Callable[[Path], object]):
    go(StagedTrainer(), tmp_path)
    damage(tmp_path / "lanes" / "human-s0" / "stage1.safetensors")
    again = StagedTrainer()
    found = results(go(again, tmp_path))
    assert again.asked[0] == ("easy", 300, {"human-s0": None})
    assert found["human-s0"].fitness == 10.0 and not found["human-s0"].message


@pytest.mark.usefixtures("lasting")
def test_pen_spinning_runs_from_end_to_end(tmp_path: Path):
    stages = curriculum.find("shadow_hand_spin", "pen_spinning")
    trainer = CurriculumTrainer(LocalExecutor(threads=1), stages, StageFiles(tmp_path))
    budget = TrainBudget(env_steps=2 * 16 * 4, worlds=4)
    found = results(trainer.train("shadow_hand_spin", SPECS, budget))
    assert {result.state for result in found.values()} == {TrainingState.FINISHED}
    assert {result.env_steps for result in found.values()} == {2 * 16 * 4}
    for spec, result in found.items():
        assert result.best_reward is not None
        assert Policy.from_bytes(result.best_reward.policy).env == "shadow_hand_spin"
        before = Policy.from_bytes((tmp_path / "lanes" / spec / "stage1.safetensors").read_bytes())
        assert before.env == "shadow_hand_spin+random_goals=true"
        # The last stage is one epoch, so its peak is the policy that acted in it: the one that ended the first stage.
        after = Policy.from_bytes(result.best_reward.policy)
        torch.testing.assert_close(dict(after.tensors), dict(before.tensors))
