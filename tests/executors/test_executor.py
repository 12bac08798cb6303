import dataclasses
import itertools
import os
import signal as signals
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from openeureka.errors import TaskError, WorkerError
from openeureka.executors import child, local, retry, snapshots, transport
from openeureka.executors.local import LocalExecutor
from openeureka.executors.snapshots import Snapshot
from openeureka.training import population
from openeureka.training.wire import pack, pack_lanes, unpack, unpack_lanes
from openeureka.types import (
    Checkpoint,
    LaneSpec,
    Node,
    RewardGraph,
    TrainBudget,
    TrainingProgress,
    TrainingResult,
    TrainingState,
)
from openeureka.worker import Frame, Worker

GRAPH = RewardGraph(nodes=(Node("input", ("pole_angle",)),), reward=0, components=(("angle", 0),))


def test_specs_and_results_survive_the_pipe():
    specs = [LaneSpec(id="a", program=GRAPH, seed=3), LaneSpec(id="b", program="human", start=b"\x03")]
    budget = TrainBudget(env_steps=5, worlds=2)
    assert unpack_lanes(pack_lanes("cartpole", specs, budget)) == ("cartpole", specs, budget)
    result = TrainingResult(
        lane="a", state=TrainingState.DIVERGED, fitness=None, curves={"fitness": (None, 1.5)}, env_steps=3, seconds=1.0,
        best_reward=Checkpoint(epoch=1, value=2.0, policy=b"\x00\x01"), last=b"\x02", message="why",
    )  # fmt: skip
    progress = TrainingProgress(epoch=1, epochs=2, env_steps_per_second=3.0, fitness={"a": None})
    assert unpack(pack(result)) == result
    assert unpack(pack(progress)) == progress


def test_a_lane_that_kills_its_worker_takes_no_other_with_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    trainer = LocalExecutor(module="dying_worker")
    specs = [LaneSpec(id=name, program="human", seed=seed) for seed, name in enumerate(["a", "b", "deadly", "late"])]
    found = {r.lane: r for r in trainer.train("cartpole", specs, TrainBudget()) if isinstance(r, TrainingResult)}
    assert [found[name].state for name in ("a", "b", "late")] == [TrainingState.FINISHED] * 3
    assert found["deadly"].state is TrainingState.FAILED
    assert "ended before it answered" in found["deadly"].message


def interrupted(monkeypatch: pytest.MonkeyPatch, folder: Path | None) -> dict[str, TrainingResult]:
    """Results of a training whose worker is killed after its first snapshot, if there is a folder for snapshots."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setattr(retry, "SNAPSHOT_SECONDS", 1e-9)
    trainer = LocalExecutor(module="interrupted_worker", snapshots=folder, threads=1)
    specs = [LaneSpec(id="human", program="human"), LaneSpec(id="angle", program=GRAPH, seed=1)]
    budget = TrainBudget(env_steps=16 * 32 * 3, worlds=32)
    found = (r for r in trainer.train("cartpole", specs, budget) if isinstance(r, TrainingResult))
    return {result.lane: dataclasses.replace(result, seconds=0.0) for result in found}


@pytest.mark.usefixtures("lasting")
def test_a_training_whose_worker_is_killed_goes_on_from_its_snapshot(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    found = interrupted(monkeypatch, tmp_path / "snapshots")
    assert found == interrupted(monkeypatch, None)  # without snapshots the worker lives
    assert list(tmp_path.iterdir()) == []


def test_a_training_that_is_stopped_goes_on_from_where_it_was(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    hold = tmp_path / "hold"  # else a worker might be at its end before it is asked to stop
    hold.touch()
    monkeypatch.setenv("HOLD", str(hold))
    monkeypatch.setattr(retry, "FAREWELL", retry.LONGEST_FAREWELL)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    specs = [LaneSpec(id="human", program="human"), LaneSpec(id="angle", program=GRAPH, seed=1)]
    budget = TrainBudget(env_steps=16 * 64 * 8, worlds=64)

    def trained(folder: Path, stop: bool) -> list[TrainingProgress | TrainingResult]:
        messages: list[TrainingProgress | TrainingResult] = []
        trainer = LocalExecutor(module="eager_worker", snapshots=folder, threads=1)  # it reports every epoch
        training = trainer.train("cartpole", specs, budget)
        for message in training:
            messages.append(message)
            if stop:
                training.close()
        return messages

    (seen,) = trained(tmp_path / "stopped", stop=True)
    hold.unlink()
    (kept,) = (tmp_path / "stopped").glob("*.pt")
    first, *_, human, angle = trained(tmp_path / "stopped", stop=False)
    assert isinstance(seen, TrainingProgress) and isinstance(first, TrainingProgress)
    assert first.epoch > seen.epoch and not kept.exists()
    undisturbed = trained(tmp_path / "undisturbed", stop=False)[-2:]
    for result, expected in zip((human, angle), undisturbed, strict=True):
        assert dataclasses.replace(result, seconds=0.0) == dataclasses.replace(expected, seconds=0.0)


@pytest.mark.usefixtures("lasting")
def test_lanes_without_a_result_go_on_alone_from_the_snapshot_of_all(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """The run was stopped while it stored the results of a population."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setattr(retry, "SNAPSHOT_SECONDS", 1e-9)
    specs = [LaneSpec(id=f"angle-{seed}", program=GRAPH, seed=seed) for seed in range(3)]
    budget = TrainBudget(env_steps=16 * 64 * 5, worlds=64)

    def trained(lanes: list[LaneSpec], stop: bool = False) -> tuple[list[int], dict[str, TrainingResult]]:
        epochs, found = list[int](), dict[str, TrainingResult]()
        trainer = LocalExecutor(module="eager_worker", snapshots=tmp_path / "snapshots", threads=1)
        training = trainer.train("cartpole", lanes, budget)
        for message in training:
            if isinstance(message, TrainingProgress):
                epochs.append(message.epoch)
            else:
                found[message.lane] = message
                if stop:
                    training.close()
        return epochs, found

    _, first = trained(specs, stop=True)
    assert list(first) == ["angle-0"] and list((tmp_path / "snapshots").glob("*.pt"))
    epochs, rest = trained(specs[1:])
    assert list(rest) == ["angle-1", "angle-2"] and epochs in ([], [5])  # [5]: from the last epoch
    assert list(tmp_path.iterdir()) == []
    _, whole = trained(specs)
    for lane, result in rest.items():
        assert result.curves.keys() == whole[lane].curves.keys()  # also the parts of components
        assert result.curves["reward"] == pytest.approx(whole[lane].curves["reward"], rel=1e-3)
        assert result.env_steps == whole[lane].env_steps and len(result.clock) == 5


def test_a_state_is_suspect_from_when_a_worker_has_it_until_that_went_on(tmp_path: Path):
    snapshot = Snapshot(tmp_path / "snapshots", {"what": "is trained"})
    assert snapshot.read() is None and not snapshot.suspect
    snapshot.write(b"state")
    assert not snapshot.suspect
    assert snapshot.read() == b"state" and snapshot.suspect
    snapshot.trust()
    assert not snapshot.suspect
    assert snapshot.read() == b"state" and snapshot.suspect
    snapshot.distrust()
    assert snapshot.read() is None and not snapshot.suspect
    assert list(tmp_path.iterdir()) == []


def test_what_is_left_of_a_training_keeps_the_populations_that_left_a_snapshot(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    def populations(names: str) -> list[list[str]]:
        found: list[list[str]] = []
        trainer = LocalExecutor(threads=2, snapshots=tmp_path)

        def train(transport, populations, seats) -> tuple[()]:
            found.extend([lane.id for lane in population.lanes] for population in populations)
            return ()

        monkeypatch.setattr(local.scheduler, "train", train)
        list(trainer.train("cartpole", [LaneSpec(id=name, program="human") for name in names], budget))
        return found

    def snapshot(env: str, names: str, device: str = "cpu") -> Snapshot:
        lanes = [{"id": name} for name in names]
        return Snapshot(tmp_path, {**pack_lanes(env, (), budget).header, "lanes": lanes, "device": device})

    budget = TrainBudget(worlds=1)

    assert populations("abcdefg") == [["a", "b", "c", "d"], ["e", "f", "g"]]
    snapshot("cartpole", "efg").write(b"state")
    snapshot("ant", "f").write(b"state")
    snapshot("cartpole", "abcdefg", device="cuda").write(b"state")  # a CPU cannot continue from it
    assert populations("efg") == [["e", "f", "g"]]
    assert populations("adefg") == [["e", "f", "g"], ["a", "d"]]
    assert populations("aef") == [["e", "f"], ["a"]]  # g has its result
    snapshot("cartpole", "efg").remove()
    assert populations("efg") == [["e", "f"], ["g"]]


def test_another_training_does_not_go_on_from_this_snapshot(tmp_path: Path):
    Snapshot(tmp_path, {"worlds": 2}).write(b"state")
    assert Snapshot(tmp_path, {"worlds": 2}).read() == b"state"
    assert Snapshot(tmp_path, {"worlds": 3}).read() is None


def test_a_snapshot_serves_those_lanes_of_it_that_are_asked_for_alike(tmp_path: Path):
    def asked(*lanes: str, worlds: int = 2, **starts: str) -> Snapshot:
        own = [{"id": lane[0], "program": lane} for lane in lanes]
        return Snapshot(tmp_path / "snapshots", {"env": "ant", "worlds": worlds, "lanes": own, "starts": starts})

    asked("a", "b", "c", b="x").write(b"state")
    for other in (asked("a2", "c"), asked("a", "d"), asked("a", worlds=3), asked("b"), asked("b", b="y")):
        assert other.read() is None
    fewer = asked("c", "b", b="x")
    assert fewer.read() == b"state"
    fewer.write(b"later")
    assert snapshots.groups(tmp_path / "snapshots", {"env": "ant", "worlds": 2}) == [["c", "b"]]
    assert snapshots.groups(tmp_path / "snapshots", {"env": "ant", "worlds": 3}) == [] and asked("a").read() is None
    assert asked("b", b="x").read() == b"later"
    fewer.remove()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("lasting")
def test_training_and_evaluation_in_a_worker_load_no_compiler(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    trainer = LocalExecutor(module="lean_worker", threads=1)
    specs = [LaneSpec(id="a", program="human")]
    budget = TrainBudget(env_steps=16 * 32 * 2, worlds=32)
    (result,) = (r for r in trainer.train("cartpole", specs, budget) if isinstance(r, TrainingResult))
    assert result.best_fitness is not None
    (score,) = trainer.evaluate("cartpole", {"a": result.best_fitness.policy}, seed=0)
    assert score.lane == "a" and score.episodes == 256
    assert score.fitness == pytest.approx(score.episode_length)


@pytest.mark.usefixtures("lasting")
def test_lanes_that_are_too_many_for_one_simulation_train_one_population_after_another():
    trainer = LocalExecutor(threads=1, max_worlds=64)
    specs = [LaneSpec(id=str(i), program="human", seed=i) for i in range(3)]
    budget = TrainBudget(env_steps=16 * 32, worlds=32)
    together = LocalExecutor(threads=1)
    split, whole = (
        [r for r in t.train("cartpole", specs, budget) if isinstance(r, TrainingResult)] for t in (trainer, together)
    )
    assert [result.lane for result in split] == [result.lane for result in whole] == ["0", "1", "2"]
    for apart, beside in zip(split, whole, strict=True):
        assert apart.curves["reward"] == pytest.approx(beside.curves["reward"], rel=1e-3)


def test_a_worker_that_hangs_is_given_up(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    trainer = LocalExecutor(module="silent_worker", silence=0.2)
    (result,) = trainer.train("cartpole", [LaneSpec(id="a", program="human")], TrainBudget())
    assert isinstance(result, TrainingResult) and result.state is TrainingState.FAILED
    assert "did not answer in time" in result.message


class Clock:
    """The clock by which silence is counted, `ahead` [s] of the true one."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.ahead = 0.0
        monkeypatch.setattr(transport, "time", SimpleNamespace(monotonic=lambda: time.monotonic() + self.ahead))


def test_who_was_stopped_itself_gives_up_no_worker_that_was_stopped_too(monkeypatch: pytest.MonkeyPatch):
    """`docker pause`, or SIGSTOP to a whole job, stops both processes."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    clock = Clock(monkeypatch)
    workers, wait = list[Worker](), transport.connection.wait

    def started(*args: Any, **options: Any) -> Worker:
        workers.append(Worker(*args, **options))
        return workers[-1]

    def stopped(fds: list[int], timeout: float) -> None:
        if len(workers) == 1 and not naps:
            naps.append(workers[0].process.pid)
            os.kill(naps[0], signals.SIGSTOP)
            clock.ahead += 700.0  # both processes stood still, and the worker wakes later
            threading.Timer(0.5, os.kill, (naps[0], signals.SIGCONT)).start()
        else:
            wait(fds, timeout)

    naps = list[int]()
    monkeypatch.setattr(transport, "Worker", started)
    monkeypatch.setattr(transport, "connection", SimpleNamespace(wait=stopped))
    (score,) = LocalExecutor(module="evaluating_worker", silence=600.0).evaluate("cartpole", {"a": b""}, seed=0)
    assert len(workers) == 1 and score.lane == "a"


def test_an_evaluation_may_take_longer_than_a_worker_may_be_silent(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    clock = Clock(monkeypatch)

    class Slow(Worker):
        """Each of its eight signs of life comes 200 s after the one before."""

        def receive(self, timeout: float | None = None) -> Frame:
            frame = super().receive(timeout)
            clock.ahead += 200.0
            return frame

    monkeypatch.setattr(transport, "Worker", Slow)
    (score,) = LocalExecutor(module="evaluating_worker", silence=600.0).evaluate("cartpole", {"a": b""}, seed=0)
    assert (score.lane, score.fitness, score.episode_length, score.episodes) == ("a", 1.0, 2.0, 3)


def test_a_training_that_comes_back_to_where_it_was_gives_signs_of_life(monkeypatch: pytest.MonkeyPatch):
    said: list[dict] = []
    seconds = [0.0]
    request = pack_lanes("cartpole", [LaneSpec(id="a", program="human")], TrainBudget(env_steps=64, worlds=4))
    header = {"do": "train", "device": "cpu", "threads": 0, "snapshot_seconds": 0.0, **request.header}
    left = [Frame(header, request.blobs), None]

    class Said:
        def receive(self):
            return left.pop(0)

        def ready(self):
            return False

        def send(self, header, blobs=None):
            said.append(header)

    class Replaying(population.Population):
        def __init__(self, *args, alive, **options):
            for _ in range(3):
                seconds[0] += 1.01
                alive()
            super().__init__(*args, alive=alive, **options)

    monkeypatch.setattr(child, "Channel", Said)
    monkeypatch.setattr(child, "Population", Replaying)
    monkeypatch.setattr(child, "time", SimpleNamespace(monotonic=lambda: seconds[0]))
    child.main()
    assert said[:3] == [{}] * 3 and said[-1] == {"done": True}


def test_a_training_gives_signs_of_life_however_long_its_epochs_are(monkeypatch: pytest.MonkeyPatch):
    said: list[dict] = []
    request = pack_lanes("cartpole", [LaneSpec(id="a", program="human")], TrainBudget(env_steps=64, worlds=4))
    header = {"do": "train", "device": "cpu", "threads": 0, "snapshot_seconds": 0.0, **request.header}
    seconds = itertools.count(0.0, 2.0)
    channel = SimpleNamespace(
        receive=iter([Frame(header, request.blobs), None]).__next__,
        ready=lambda: False,
        send=lambda header, blobs=None: said.append(header),
    )
    monkeypatch.setattr(child, "Channel", lambda: channel)
    monkeypatch.setattr(child, "time", SimpleNamespace(monotonic=lambda: next(seconds)))
    child.main()
    # Signs of life: for the task, its worlds, their start and each of 16 steps. On the fake clock each takes seconds.
    assert said.index(next(header for header in said if header)) == 19


def test_an_unknown_environment_is_an_error_of_the_caller_and_not_of_the_worker():
    with pytest.raises(TaskError, match="Did you mean `cartpole`"):
        list(LocalExecutor().train("cartpol", [LaneSpec(id="a", program="human")], TrainBudget(worlds=1)))


@pytest.mark.parametrize(
    ("signal", "sentence"),
    [
        ("SIGSEGV", "It was ended by SIGSEGV."),
        ("SIGKILL", "when memory runs out: use fewer worlds="),
        ("SIGSTOP", "did not answer in time"),
        ("RLIMIT_AS", "MemoryError Raise `ulimit -v`, or use fewer worlds="),
    ],
)
def test_what_the_kernel_does_to_a_worker_is_said(signal: str, sentence: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    trainer = LocalExecutor(module="ended_worker", silence=2.0 if signal == "SIGSTOP" else transport.SILENCE)
    (result,) = trainer.train("cartpole", [LaneSpec(id=signal, program="human")], TrainBudget())
    assert isinstance(result, TrainingResult) and result.state is TrainingState.FAILED
    assert sentence in result.message


def test_a_reward_that_ends_its_worker_has_a_result_also_when_it_trains_alone(monkeypatch: pytest.MonkeyPatch):
    """The human reward trains on this machine, so the reward is at fault."""
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    (result,) = LocalExecutor(module="choosy_worker").train(
        "cartpole", [LaneSpec(id="a", program=GRAPH)], TrainBudget()
    )
    assert isinstance(result, TrainingResult) and result.state is TrainingState.FAILED
    assert "It was ended by SIGFPE." in result.message


def test_where_not_even_the_human_reward_trains_the_machine_is_at_fault(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    with pytest.raises(WorkerError, match="It was killed"):
        list(LocalExecutor(module="killed_worker").train("cartpole", [LaneSpec(id="a", program=GRAPH)], TrainBudget()))


def test_a_worker_that_dies_in_an_evaluation_is_started_again_once_for_what_is_left(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    trainer = LocalExecutor(module="half_evaluating_worker")
    untrained = {"a": 0, "b": 1}
    scores = trainer.evaluate("cartpole", {"a": b"", "b": b""}, seed=0, untrained=untrained)
    assert [score.lane for score in scores] == ["a", "b"]
    scores = trainer.evaluate("cartpole", {"a": b"", "b": b"", "c": b""}, seed=0)
    assert [next(scores).lane, next(scores).lane] == ["a", "b"]
    with pytest.raises(WorkerError, match="ended before it answered"):
        next(scores)


def test_a_program_that_ends_its_worker_takes_no_other_with_it_where_programs_are_paid(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    trainer = LocalExecutor(module="paying_worker")
    assert list(trainer.rewards("cartpole", dict.fromkeys(["a", "deadly", "b", "c"], GRAPH), [])) == ["a", "b", "c"]
