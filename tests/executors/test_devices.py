import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import pytest
import torch

from openeureka.errors import ConfigError
from openeureka.executors import scheduler
from openeureka.executors.local import CPU_WORKERS, LocalExecutor, devices, workers
from openeureka.types import LaneSpec, TrainBudget, TrainingEvent, TrainingProgress, TrainingResult, TrainingState


@pytest.fixture
def signal(tmp_path: Path) -> Path:
    """The file that lanes named `patient...` wait for."""
    return tmp_path / "signal"


@pytest.fixture
def gpus(monkeypatch: pytest.MonkeyPatch, signal: Path) -> None:
    """Pretend that there are three GPUs. The workers only report which one they were given."""
    monkeypatch.setattr("openeureka.executors.local.check_device", lambda _: None)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 3)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setenv("SIGNAL", str(signal))


def train(names: Sequence[str], device: str = "cuda", **options) -> Iterator[TrainingEvent]:
    trainer = LocalExecutor(device, module="reporting_worker", **options)
    return trainer.train("cartpole", [LaneSpec(id=name, program="human") for name in names], TrainBudget())


def results(found: Iterable[TrainingEvent]) -> dict[str, TrainingResult]:
    return {message.lane: message for message in found if isinstance(message, TrainingResult)}


def test_a_setting_names_one_device_a_worker(gpus):
    assert devices("cpu") == ("cpu",)
    assert devices("cuda") == ("cuda:0", "cuda:1", "cuda:2")
    assert devices("cuda:2") == ("cuda:2",)
    assert devices("cuda:0, cuda:2") == ("cuda:0", "cuda:2")
    assert devices("cuda:1,cuda:1") == ("cuda:1", "cuda:1")


@pytest.mark.parametrize(
    ("threads", "populations", "expected"),
    [
        (4, 1, [4]),
        (4, 2, [2, 2]),
        (4, 3, [1, 1, 1]),
        (1, 7, [1]),
        (CPU_WORKERS * 2, 100, [2] * CPU_WORKERS),
    ],
)
def test_the_cores_of_a_cpu_are_dealt_to_workers(threads: int, populations: int, expected: list[int]):
    assert [number for _, number in workers(("cpu",), threads, populations)] == expected


def test_devices_that_are_named_get_a_worker_each():
    assert workers(("cpu", "cpu"), 0, 1) == (("cpu", 0), ("cpu", 0))
    assert workers(("cuda:0", "cuda:1"), 3, 9) == (("cuda:0", 3), ("cuda:1", 3))


def test_lanes_on_a_cpu_train_side_by_side(monkeypatch: pytest.MonkeyPatch, gpus, signal: Path):
    # Each of two workers waits until both have reported.
    pids: set[float | None] = set()
    for message in train(["patient0", "patient1", "patient2", "patient3"], "cpu", threads=2):
        if isinstance(message, TrainingProgress):
            pids |= set(message.fitness.values())
        if len(pids) == 2:
            signal.touch()
    assert signal.exists()


@pytest.mark.parametrize(
    ("device", "expected"),
    [("cpu", ["ab", "cd", "ef"]), ("cuda:1,cuda:1", ["ab", "cd", "ef"]), ("cuda:0,cuda:1", ["abc", "def"])],
)
def test_worlds_of_all_workers_on_a_device_count(monkeypatch: pytest.MonkeyPatch, gpus, device, expected):
    dealt: list[str] = []

    def noted(transport, populations, seats) -> tuple[()]:
        dealt.extend("".join(lane.id for lane in population.lanes) for population in populations)
        return ()

    monkeypatch.setattr(scheduler, "train", noted)
    trainer = LocalExecutor(device, threads=2, max_worlds=1024)  # 256 worlds a lane: room for four on a device
    list(trainer.train("cartpole", [LaneSpec(id=name, program="human") for name in "abcdef"], TrainBudget()))
    assert dealt == expected


@pytest.mark.parametrize("setting", ["", "cpu,", "cpu,tpu"])
def test_each_of_the_devices_must_exist(setting):
    with pytest.raises(ConfigError, match="There is no device"):
        LocalExecutor(setting)


def test_lanes_are_spread_over_all_gpus(gpus):
    found = results(train([f"lane{i}" for i in range(7)]))
    # 7 lanes, 3 devices: 3, 3 and 1
    assert Counter(result.message for result in found.values()) == {"cuda:0": 3, "cuda:1": 3, "cuda:2": 1}


def test_results_come_as_they_are_ready_and_a_gpu_that_is_done_takes_the_next_population(gpus, signal):
    # Two lanes of 256 worlds a population: four populations for two devices, of which the first is busy throughout.
    names = ["patient0", "patient1", "a", "b", "c", "d", "e", "f"]
    found: dict[str, TrainingResult] = {}
    for message in train(names, "cuda:0,cuda:1", max_worlds=512):
        found |= results([message])
        if len(found) == 6:
            signal.touch()
    assert list(found) == ["a", "b", "c", "d", "e", "f", "patient0", "patient1"]
    assert [result.message for result in found.values()] == ["cuda:1"] * 6 + ["cuda:0"] * 2


def test_a_worker_that_dies_repeats_its_own_lanes_only(gpus):
    found = list(train(["a", "deadly", "c", "d"], "cuda:0,cuda:1"))
    states = {name: result.state for name, result in results(found).items()}
    assert states == {"a": "finished", "deadly": "failed", "c": "finished", "d": "finished"}
    assert len([message for message in found if isinstance(message, TrainingResult)]) == 4
    workers = {message.fitness.get("d") for message in found if isinstance(message, TrainingProgress)}
    # The worker of c and d lived on, so no other one ever trained d.
    assert len(workers - {None}) == 1


def test_progress_is_that_of_all_gpus(gpus, signal):
    seen: list[TrainingProgress] = []
    for message in train(["patient0", "patient1", "patient2"]):
        if isinstance(message, TrainingProgress):
            seen.append(message)
        if len(seen) == 3:
            signal.touch()
    assert [(m.epoch, m.epochs, m.env_steps_per_second) for m in seen] == [(1, 4, 100), (2, 4, 200), (3, 4, 300)]
    assert set(seen[-1].fitness) == {"patient0", "patient1", "patient2"}


def test_whoever_stops_listening_leaves_no_worker_behind(gpus):
    stream = train(["patient0", "patient1", "patient2"])
    pids: set[int] = set()
    while len(pids) < 3:
        message = next(stream)
        assert isinstance(message, TrainingProgress)
        pids = {int(pid) for pid in message.fitness.values() if pid is not None}
    del stream
    assert not any(os.path.exists(f"/proc/{pid}") for pid in pids)


@pytest.mark.usefixtures("lasting")
def test_lanes_learn_the_same_in_two_processes_as_in_one():
    specs = [LaneSpec(id=name, program="human", seed=seed) for seed, name in enumerate("ab")]
    budget = TrainBudget(env_steps=16 * 32 * 2, worlds=32)
    apart, beside = (
        results(LocalExecutor(device, threads=1).train("cartpole", specs, budget)) for device in ("cpu,cpu", "cpu")
    )
    for name in "ab":
        assert apart[name].state is TrainingState.FINISHED
        assert apart[name].curves["reward"] == pytest.approx(beside[name].curves["reward"], rel=1e-3)
