"""What the Ray executor waits for, and how long, on a cluster that is only a list of cores: no process, no actor."""

import time
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from openeureka.errors import WorkerError
from openeureka.executors import ray, ray_node
from openeureka.executors.ray import RayExecutor
from openeureka.types import Node, RewardGraph
from openeureka.worker import Frame, framed

GRAPH = RewardGraph(nodes=(Node("input", ("pole_angle",)),), reward=0, components=(("angle", 0),))


class Gone(Exception):
    """What Ray raises for an actor that is gone."""


class Stream:
    """What an actor says, as soon as a node has its cores."""

    def __init__(self, cluster: "Cluster", cores: int, said: Sequence[Frame | Gone]) -> None:
        node = {"id": "n", "host": "alpha", "token": True, "versions": ray_node.versions()}
        self._cluster, self._cores, self._left = cluster, cores, [Frame({"node": node}), *said]

    @property
    def ready(self) -> bool:
        return bool(self._left) and max(self._cluster.cores, default=0) >= self._cores

    def __next__(self) -> bytes | Gone:
        assert self.ready, "this would wait for ever"
        frame = self._left.pop(0)
        return frame if isinstance(frame, Gone) else framed(frame.header, frame.blobs)


class Cluster:
    """The part of the module `ray` that the executor uses."""

    exceptions = SimpleNamespace(RayError=Gone, RayTaskError=ZeroDivisionError)

    def __init__(self, cores: Sequence[int], script: Callable[[int], Sequence[Frame | Gone]]) -> None:
        self.cores, self.script = list(cores), script
        self.asked: list[int] = []
        """Cores of each actor."""
        self.looks = 0

    def nodes(self) -> list[dict[str, Any]]:
        self.looks += 1
        return [{"Alive": True, "NodeID": str(i), "Resources": {"CPU": n}} for i, n in enumerate(self.cores)]

    def get_runtime_context(self) -> Any:
        return SimpleNamespace(gcs_address="127.0.0.1:6379")

    def remote(self, kind: type) -> Any:
        def options(num_cpus: int, **others: object) -> Any:
            self.asked.append(num_cpus)
            stream = Stream(self, num_cpus, self.script(len(self.asked)))
            serve = SimpleNamespace(options=lambda **others: SimpleNamespace(remote=lambda *request: stream))
            return SimpleNamespace(remote=lambda module: SimpleNamespace(serve=serve))

        return SimpleNamespace(options=options)

    def wait(self, streams: Sequence[Stream], num_returns: int = 1, timeout: float = 0.0) -> tuple[list[Stream], None]:
        ready = [stream for stream in streams if stream.ready]
        time.sleep(0.0 if ready else min(timeout, 0.02))
        return ready[:num_returns], None

    def get(self, said: bytes | Gone, timeout: float) -> bytes:
        if isinstance(said, Gone):
            raise said
        return said

    def kill(self, actor: object) -> None: ...


def executor(cluster: Cluster, monkeypatch: pytest.MonkeyPatch, **options: Any) -> RayExecutor:
    monkeypatch.setattr(ray, "connect", lambda address: cluster)
    monkeypatch.setattr(ray, "POLL", 0.01)
    return RayExecutor(**options)


def test_a_worker_that_hangs_in_an_evaluation_is_given_up(monkeypatch: pytest.MonkeyPatch):
    cluster = Cluster([1], lambda call: [])
    trainer = executor(cluster, monkeypatch, silence=0.1)
    with pytest.raises(WorkerError, match="did not answer in time"):
        list(trainer.evaluate("cartpole", {"a": b""}, seed=0))
    assert trainer.rewards("cartpole", {"a": GRAPH}, []) == {}
    assert cluster.asked == [1] * 4  # each was tried once more
