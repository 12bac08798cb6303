"""What the Ray executor waits for, and how long, on a fake cluster: a list of the nodes' cores, with no process."""

import logging
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from openeureka.cli import doctor
from openeureka.errors import ConfigError, TaskError, WorkerError
from openeureka.executors import cluster as clusters
from openeureka.executors import ray, ray_node
from openeureka.executors.ray import RayExecutor
from openeureka.training.wire import pack, unpack_lanes
from openeureka.types import LaneSpec, Node, RewardGraph, TrainBudget, TrainingProgress, TrainingResult, TrainingState
from openeureka.worker import Frame, framed, unframed

GRAPH = RewardGraph(nodes=(Node("input", ("pole_angle",)),), reward=0, components=(("angle", 0),))


class Gone(Exception):
    """What Ray raises for an actor that is gone. With it, the fake cluster loses its first node."""


class Stream:
    """What an actor says. It begins once a node has the cores that it asks for and no other actor is at work."""

    def __init__(self, cluster: "Cluster", cores: int, said: Sequence[Frame | Gone], node: dict[str, Any]) -> None:
        self._cluster, self._cores, self._left = cluster, cores, [Frame({"node": node}), *said]

    @property
    def ready(self) -> bool:
        if self._left and self._cluster.at_work is None and max(self._cluster.cores) >= self._cores:
            self._cluster.at_work = self
        return self._cluster.at_work is self and bool(self._left)

    def __next__(self) -> bytes | Gone:
        assert self.ready, "this would wait for ever"
        frame = self._left.pop(0)
        if not self._left:
            self._cluster.at_work = None
        return frame if isinstance(frame, Gone) else framed(frame.header, frame.blobs)


class Cluster:
    """The part of the module `ray` that the executor uses."""

    exceptions = SimpleNamespace(RayError=Gone, RayTaskError=ZeroDivisionError)

    def __init__(self, *cores: int, script: Callable[[int, Frame], Sequence[Frame | Gone]]) -> None:
        self.cores, self.script = list(cores), script
        self.at_work: Stream | None = None
        self.asked: list[int] = []
        """Cores of each actor."""
        self.joining: list[int] = []
        """Cores of the nodes that will join: one at each call of `nodes`, from the third call on."""
        self.looks = 0
        self.away: list[str] = []
        """Which nodes each actor must avoid, in Ray's notation."""

    def place(self, away: str) -> dict[str, Any]:
        """What the node that takes an actor says of itself."""
        return {"id": "n", "host": "alpha", "token": True, "versions": ray_node.versions()}

    def nodes(self) -> list[dict[str, Any]]:
        self.looks += 1
        if self.looks > 2 and self.joining:
            self.cores.append(self.joining.pop(0))
        return [{"Alive": True, "NodeID": str(i), "Resources": {"CPU": n}} for i, n in enumerate(self.cores)]

    def get_runtime_context(self) -> Any:
        return SimpleNamespace(gcs_address="127.0.0.1:6379")

    def remote(self, kind: type) -> Any:
        def options(num_cpus: int, **others: Any) -> Any:
            self.asked.append(num_cpus)
            self.away.append(others.get("label_selector", {}).get("ray.io/node-id", ""))
            number, node = len(self.asked), self.place(self.away[-1])

            def called(request: bytes, device: str, threads: int) -> Stream:
                return Stream(self, num_cpus, self.script(number, unframed(request)), node)

            serve = SimpleNamespace(options=lambda **others: SimpleNamespace(remote=called))
            return SimpleNamespace(remote=lambda module: SimpleNamespace(serve=serve))

        return SimpleNamespace(options=options)

    def wait(self, streams: Sequence[Stream], num_returns: int = 1, timeout: float = 0.0) -> tuple[list[Stream], None]:
        ready = [stream for stream in streams if stream.ready]
        time.sleep(0.0 if ready else min(timeout, 0.02))
        return ready[:num_returns], None

    def get(self, said: bytes | Gone, timeout: float) -> bytes:
        if isinstance(said, Gone):
            self.cores = self.cores[1:]
            self.looks = 0
            raise said
        return said

    def kill(self, actor: object) -> None: ...


def executor(cluster: Cluster, monkeypatch: pytest.MonkeyPatch, **options: Any) -> RayExecutor:
    monkeypatch.setattr("openeureka.executors.cluster.connect", lambda address: cluster)
    monkeypatch.setattr(ray, "POLL", 0.01)
    return RayExecutor(**options)


def test_a_worker_that_hangs_in_an_evaluation_is_given_up(monkeypatch: pytest.MonkeyPatch):
    cluster = Cluster(1, script=lambda number, request: [])
    trainer = executor(cluster, monkeypatch, silence=0.1)
    with pytest.raises(WorkerError, match="did not answer in time"):
        list(trainer.evaluate("cartpole", {"a": b""}, seed=0))
    assert trainer.rewards("cartpole", {"a": GRAPH}, []) == {}
    assert cluster.asked == [1] * 4  # an evaluation and a question, each tried twice


def results(number: int, request: Frame) -> list[Frame | Gone]:
    """What a worker says if all of its lanes train."""
    lanes = [lane.id for lane in unpack_lanes(request)[1]]
    ended = {"state": TrainingState.FINISHED, "fitness": 1.0, "curves": {}, "env_steps": 1, "seconds": 0.0}
    return [*(pack(TrainingResult(lane=lane, **ended)) for lane in lanes), Frame({"done": True})]


def after_a_loss(number: int, request: Frame) -> list[Frame | Gone]:
    return [Gone()] if number == 1 else results(number, request)


def trained(trainer: RayExecutor, lanes: str) -> list[str]:
    specs = [LaneSpec(id=name, program="human") for name in lanes]
    return [m.lane for m in trainer.train("cartpole", specs, TrainBudget(worlds=1)) if isinstance(m, TrainingResult)]


def test_a_search_waits_for_a_node_and_says_so(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture):
    cluster = Cluster(0, script=results)  # a head node without cores
    cluster.joining = [8]
    trainer = executor(cluster, monkeypatch, threads=8)
    assert trained(trainer, "a") == ["a"]
    cluster.cores, cluster.joining, cluster.looks = [0, 4], [8], 0  # the node of 8 cores has left
    assert trained(trainer, "b") == ["b"]
    assert cluster.asked == [8, 8]
    assert [record.levelno for record in caplog.records if "waiting for one" in record.message] == [logging.WARNING] * 2


def test_a_process_that_is_part_of_one_cluster_is_not_told_that_it_joined_another(monkeypatch: pytest.MonkeyPatch):
    joined: list[str] = []
    fake = Cluster(4, script=results)
    fake.is_initialized = lambda: bool(joined)
    fake.init = lambda address, **others: joined.append(address)
    monkeypatch.setattr(clusters, "_imported", lambda address: fake)
    monkeypatch.setattr(clusters, "_joined", "")
    for address in ("local", "local", "127.0.0.1:6379"):  # the last is the fake cluster's address
        assert clusters.connect(address) is fake
    with pytest.raises(ConfigError, match=r"at address=local: restart it to join 10\.0\.0\.5:6379\."):
        clusters.connect("10.0.0.5:6379")
    assert joined == ["local"]


def test_who_handles_sigterm_still_does_once_this_process_is_part_of_a_cluster(monkeypatch: pytest.MonkeyPatch):
    """Ray's own handler ends the process before its trainings have left their state."""
    fake = Cluster(4, script=results)
    fake.is_initialized = lambda: False
    fake.init = lambda address, **others: signal.signal(signal.SIGTERM, lambda *_: sys.exit(15))
    monkeypatch.setattr(clusters, "_imported", lambda address: fake)
    monkeypatch.setattr(clusters, "_joined", "")
    terminated: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: terminated.append(number))
    try:
        clusters.connect("local")
        signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert terminated == [signal.SIGTERM]


def test_a_node_that_cannot_say_what_it_has_is_a_line_of_the_doctor(monkeypatch: pytest.MonkeyPatch):
    class Asked:
        """Three nodes: one lacks the package, one does not answer, one does."""

        exceptions = SimpleNamespace(RayError=Gone)

        def nodes(self) -> list[dict[str, Any]]:
            return [
                {"Alive": True, "NodeID": f"{i:056x}", "NodeManagerHostname": name, "Resources": {"CPU": 4}}
                for i, name in enumerate(("bare", "slow", "good"))
            ]

        def get_runtime_context(self) -> Any:
            return SimpleNamespace(gcs_address="127.0.0.1:6379")

        def remote(self, function: Callable[[], dict[str, Any]]) -> Any:
            return SimpleNamespace(options=lambda num_cpus, scheduling_strategy: SimpleNamespace(remote=answers.pop))

        def get(self, said: Any, timeout: float) -> dict[str, Any]:
            if isinstance(said, Exception):
                raise said
            return dict(said)

    about = {"host": "good", "token": True, "versions": ray_node.versions(), "memory": 2**30, "time": time.time()}
    bare = Gone("ray::about()\nModuleNotFoundError: No module named 'openeureka'")
    answers = [about, about, Gone("Get timed out: some object(s) not ready."), bare]
    monkeypatch.setattr(clusters, "connect", lambda address: Asked())
    # A fake module, so that this test does not import Ray: at its import it reads, once and for all, whether clusters
    # need a token, and other tests in this process set one.
    strategies = SimpleNamespace(NodeAffinitySchedulingStrategy=lambda node, soft: node)
    monkeypatch.setitem(sys.modules, "ray.util.scheduling_strategies", strategies)
    found = doctor.nodes("auto")
    assert [(finding.name, finding.good) for finding in found] == [("bare", False), ("slow", False), ("good", True)]
    assert "A node of the cluster lacks openeureka" in found[0].detail and "timed out" in found[1].detail


def test_what_no_node_of_a_cluster_has_is_refused(monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(ConfigError, match="has room for device=cuda\\."):
        trained(executor(Cluster(4, script=results), monkeypatch, device="cuda"), "a")
    with pytest.raises(ConfigError, match="has room for device=cpu threads=8\\."):
        trained(executor(Cluster(4, script=results), monkeypatch, threads=8), "a")


def test_where_a_large_node_left_its_lanes_go_on_with_the_cores_of_another(monkeypatch: pytest.MonkeyPatch):
    cluster = Cluster(16, 4, script=after_a_loss)
    assert sorted(trained(executor(cluster, monkeypatch), "ab")) == ["a", "b"]
    assert cluster.asked == [8, 8, 4, 4]  # the second waited for a place when the node left


class Mixed(Cluster):
    """Three nodes. What `odd` holds for a node, such as other versions, replaces what it says of itself."""

    odd: Mapping[str, Mapping[str, Any]]

    def place(self, away: str) -> dict[str, Any]:
        name = next(name for name in "012" if name not in away)
        return {**super().place(away), "id": name, "host": f"node-{name}", **self.odd.get(name, {})}

    def kill(self, actor: object) -> None:
        self.at_work = None


def mixed(odd: Mapping[str, Mapping[str, Any]], script: Callable[[int, Frame], Sequence[Frame | Gone]]) -> Mixed:
    cluster = Mixed(4, 4, 4, script=script)
    cluster.odd = odd
    return cluster


OTHER = {"versions": {**ray_node.versions(), "mujoco": "9.9"}}


def test_a_node_with_other_versions_is_left_out(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture):
    cluster = mixed({"0": OTHER}, results)
    trainer = executor(cluster, monkeypatch)
    assert trained(trainer, "ab") == ["a", "b"] and trained(trainer, "c") == ["c"]
    assert cluster.away == ["", "", "!in(0)", "!in(0)", "!in(0)"]  # two were sent before node 0 told its versions
    (warning,) = (record.message for record in caplog.records)
    assert warning.startswith("Node node-0 runs mujoco 9.9, and this machine mujoco ") and "install the same" in warning
    cluster = mixed(dict.fromkeys("012", OTHER), results)
    with pytest.raises(ConfigError, match=r"Node node-2 runs mujoco 9\.9"):
        trained(executor(cluster, monkeypatch), "a")


def test_a_node_that_takes_orders_from_anybody_still_ends_the_search(monkeypatch: pytest.MonkeyPatch):
    cluster = mixed({"0": {"token": False}}, results)
    monkeypatch.setattr(clusters, "exposed", lambda ray: True)
    with pytest.raises(ConfigError, match="RAY_AUTH_MODE=token"):
        trained(executor(cluster, monkeypatch), "a")


@pytest.mark.parametrize(("reported", "away"), [(False, ["", "!in(0)", ""]), (True, ["", "", ""])])
def test_what_died_on_a_node_before_it_reported_is_tried_on_another(
    monkeypatch: pytest.MonkeyPatch, reported: bool, away: list[str]
):
    progress = TrainingProgress(epoch=1, epochs=2, env_steps_per_second=1.0, fitness={"a": None})

    def script(number: int, request: Frame) -> Sequence[Frame | Gone]:
        return [*[pack(progress)] * reported, Frame({"died": "It was killed."})] if number == 1 else results(0, request)

    cluster = mixed({}, script)
    trainer = executor(cluster, monkeypatch)
    assert trained(trainer, "a") == ["a"] and trained(trainer, "b") == ["b"]
    assert cluster.away == away
    alone = mixed({}, script)
    alone.cores = [4]
    assert trained(executor(alone, monkeypatch), "a") == ["a"] and alone.away == ["", ""]


def test_on_gpus_the_version_of_what_steps_the_worlds_counts(monkeypatch: pytest.MonkeyPatch):
    def refused(device: str, here: str, there: str) -> bool:
        versions = {**ray_node.versions(), "mujoco-warp": there}
        monkeypatch.setattr(ray_node, "versions", lambda: {**versions, "mujoco-warp": here})
        try:
            clusters.check({"host": "far", "versions": versions}, guarded=False, device=device)
        except ConfigError as error:
            assert f"Node far runs mujoco-warp {there}, and this machine mujoco-warp {here}:" in str(error)
            return True
        return False

    assert refused("cuda", "4.0.0", "4.1.0") and refused("cuda", "4.0.0", "none")
    assert not refused("cpu", "4.0.0", "4.1.0") and not refused("cuda", "4.0.0", "4.0.0")
    assert not refused("cuda", "none", "4.1.0")  # this machine only searches: it needs no package for GPUs


def test_a_node_with_another_file_of_the_task_is_left_out(tmp_path: Path):
    file = tmp_path / "mine+1.py"
    file.write_text("here")
    env = f'{file}:Mine+goal="a.py"'
    node = {"host": "far", "versions": ray_node.versions(), "task": ray_node.task_digest(env)}
    clusters.check(node, guarded=False, env=env)
    for task in (ray_node.task_digest(f"{tmp_path}/none.py"), "of another"):
        with pytest.raises(ConfigError, match=r"Node far lacks .*, or its file of that name differs"):
            clusters.check({**node, "task": task}, guarded=False, env=env)
    assert ray_node.task_digest("cartpole") == ray_node.task_digest("gym:Hopper-v5") == ""


def test_the_error_of_a_task_names_the_node(monkeypatch: pytest.MonkeyPatch):
    cluster = Cluster(4, script=lambda number, request: [Frame({"broken": "It has no such file."})])
    with pytest.raises(TaskError, match=r"It has no such file\. That was on alpha\."):
        trained(executor(cluster, monkeypatch), "a")


def test_cores_that_a_person_asked_for_are_waited_for(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    def replaced(number: int, request: Frame) -> list[Frame | Gone]:
        cluster.joining = [8] * (number - 1)  # joins once the first has left, however late that is
        return after_a_loss(number, request)

    cluster = Cluster(8, 4, script=replaced)
    assert trained(executor(cluster, monkeypatch, threads=8), "a") == ["a"]
    assert cluster.asked == [8, 8] and "waiting for one" in caplog.text
