from pathlib import Path

import pytest

from openeureka.training.executor import PopulationTrainer
from openeureka.training.wire import pack, pack_jobs, unpack, unpack_jobs
from openeureka.types import (
    Checkpoint,
    Node,
    RewardGraph,
    TrainBudget,
    TrainingProgress,
    TrainingResult,
    TrainingState,
    TrainJob,
)

GRAPH = RewardGraph(nodes=(Node("input", ("pole_angle",)),), reward=0, components=(("angle", 0),))


def test_jobs_and_results_survive_the_pipe():
    jobs = [TrainJob(id="a", program=GRAPH, seed=3), TrainJob(id="b", program="human")]
    budget = TrainBudget(env_steps=5, worlds=2)
    assert unpack_jobs(pack_jobs("cartpole", jobs, budget)) == ("cartpole", jobs, budget)
    result = TrainingResult(
        job="a", state=TrainingState.DIVERGED, fitness=None, curves={"fitness": (None, 1.5)}, env_steps=3, seconds=1.0,
        best_reward=Checkpoint(epoch=1, value=2.0, policy=b"\x00\x01"), message="why",
    )  # fmt: skip
    progress = TrainingProgress(epoch=1, epochs=2, env_steps_per_second=3.0, fitness={"a": None})
    assert unpack(pack(result)) == result
    assert unpack(pack(progress)) == progress


def test_a_worker_that_dies_is_restarted_with_what_is_left(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    trainer = PopulationTrainer(module="dying_worker")
    jobs = [TrainJob(id=name, program="human", seed=seed) for seed, name in enumerate(["a", "b", "deadly", "late"])]
    found = {r.job: r for r in trainer.train("cartpole", jobs, TrainBudget()) if isinstance(r, TrainingResult)}
    assert [found[name].state for name in "ab"] == [TrainingState.FINISHED] * 2
    assert found["deadly"].state is found["late"].state is TrainingState.FAILED
    assert "ended before it answered" in found["late"].message


def test_training_and_evaluation_in_a_worker():
    trainer = PopulationTrainer(threads=1)
    jobs = [TrainJob(id="a", program="human")]
    budget = TrainBudget(env_steps=16 * 32 * 2, worlds=32)
    (result,) = (r for r in trainer.train("cartpole", jobs, budget) if isinstance(r, TrainingResult))
    assert result.best_fitness is not None
    (score,) = trainer.evaluate("cartpole", {"a": result.best_fitness.policy}, seed=0)
    assert score.job == "a" and score.episodes == 256
    assert score.fitness == pytest.approx(score.episode_length)
