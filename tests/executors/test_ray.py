"""The Ray executor on real raylets of one core each on this machine: one, then three, which come and go."""

import dataclasses
import os
import platform
import secrets
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from types import SimpleNamespace

import pytest

from openeureka.cli import doctor
from openeureka.errors import ConfigError
from openeureka.executors import EXECUTORS, ray_node, retry
from openeureka.executors.cluster import Resources, check, shares
from openeureka.executors.local import LocalExecutor
from openeureka.executors.ray import RayExecutor
from openeureka.testing.conformance.trainer import TrainerConformance
from openeureka.types import LaneSpec, TrainBudget, TrainingProgress, TrainingResult, TrainingState

BRIEF = TrainBudget(env_steps=16 * 32 * 8, worlds=32)
SIZE = {"num_cpus": 1, "object_store_memory": 100 << 20, "node_ip_address": "127.0.0.1", "include_dashboard": False}
QUICK = {
    "health_check_initial_delay_ms": 0,
    "health_check_period_ms": 500,
    "health_check_timeout_ms": 2000,
    "health_check_failure_threshold": 8,
    "worker_niceness": 0,
}
"""Ray notices in seconds that a node hangs. Workers have normal priority, so that other programs cannot starve them."""


class Nodes:
    """A Ray cluster whose nodes a test may stop or kill."""

    def __init__(self) -> None:
        from ray.cluster_utils import Cluster

        self._cluster = Cluster(initialize_head=True, head_node_args={**SIZE, "_system_config": QUICK})

    @property
    def address(self) -> str:
        return str(self._cluster.address)

    def join(self) -> int:
        """Add a node, and return the pid of its raylet."""
        return self._cluster.add_node(**SIZE).all_processes["raylet"][0].process.pid

    def complete(self) -> None:
        """Add nodes until three are alive."""
        import ray

        if not ray.is_initialized():
            ray.init(address=self.address, log_to_driver=False)
        while sum(node["Alive"] for node in ray.nodes()) < 3:
            self.join()

    @property
    def mortal(self) -> list[int]:
        """Pids of the raylets that may be killed: all but the head's, which this process has joined."""
        return [node.all_processes["raylet"][0].process.pid for node in self._cluster.worker_nodes]

    def shares(self) -> dict[int, int]:
        """The pid of each actor that trains, with the pid of its raylet."""
        own = [*self.mortal, self._cluster.head_node.all_processes["raylet"][0].process.pid]
        stats = {pid: read(Path(f"/proc/{pid}/stat")) for pid in running(b"ray::Share.serve")}
        parents = {pid: int(stat.rpartition(b")")[2].split()[1]) for pid, stat in stats.items() if stat}
        return {pid: parent for pid, parent in parents.items() if parent in own}

    def close(self) -> None:
        self._cluster.shutdown()


def running(name: bytes) -> list[int]:
    """Pids of the processes that have `name` in their command line."""
    return [int(folder.name) for folder in Path("/proc").glob("[0-9]*") if name in read(folder / "cmdline")]


def workers() -> list[int]:
    """Pids of this cluster's workers. Its token tells them from those of other clusters."""
    token = os.environ["RAY_AUTH_TOKEN"].encode()
    return [pid for pid in running(b"eager_worker") if token in read(Path(f"/proc/{pid}/environ"))]


@contextmanager
def held() -> Iterator[None]:
    """Within it, or until `release`, eager workers wait at their second report."""
    Path(os.environ["HOLD"]).touch()
    try:
        yield
    finally:
        release()


def release() -> None:
    Path(os.environ["HOLD"]).unlink(missing_ok=True)


def read(file: Path) -> bytes:
    """A file of /proc; empty if its process has ended."""
    try:
        return file.read_bytes()
    except OSError:
        return b""


@pytest.fixture(scope="class")
def nodes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Nodes]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        patch.setenv("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")  # listens on loopback alone
        patch.setenv("RAY_AUTH_MODE", "token")
        patch.setenv("RAY_AUTH_TOKEN", secrets.token_hex(32))
        patch.setenv("PYTHONPATH", f"{Path(__file__).parent}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
        patch.setenv("HOLD", str(tmp_path_factory.mktemp("ray") / "hold"))
        patch.setattr("openeureka.executors.cluster.FULL", 1)  # so that few lanes make two rounds
        patch.setattr(retry, "FAREWELL", retry.LONGEST_FAREWELL)
        import ray

        cluster = Nodes()
        yield cluster
        ray.shutdown()
        cluster.close()


@pytest.fixture(scope="class")
def undisturbed() -> list[TrainingResult]:
    """What this machine makes of four lanes, each alone on a core, as they are where three nodes have six places in two
    rounds."""
    lanes = [LaneSpec(id=str(seed), program="human", seed=seed) for seed in range(4)]
    trained = LocalExecutor(threads=4).train("cartpole", lanes, BRIEF)
    return sorted((plain(m) for m in trained if isinstance(m, TrainingResult)), key=lambda result: result.lane)


class TestRayExecutor(TrainerConformance):
    """The conformance tests run on a single node, because every population starts a process that loads torch.

    Those set to None are left out: they test what a worker makes of its request. The request has the same bytes as for
    a worker of this machine, and there they run.
    """

    env = "cartpole"
    budget = TrainBudget(env_steps=1024, worlds=16)

    test_the_same_lanes_give_the_same_results = None
    test_lanes_that_paused_go_on_to_the_same_end = None
    test_progress_pays_nothing_to_rewards_that_tell_none = None
    test_a_lane_that_starts_from_a_policy_acts_as_that_does = None
    test_a_changed_world_leaves_the_tasks_own_beside_it_alone = None
    test_what_is_untrained_plays_as_its_seed_begins = None
    test_recorded_episodes_come_with_an_unchanged_score = None

    @pytest.fixture(autouse=True)
    def _at(self, nodes: Nodes) -> None:
        type(self).nodes = nodes

    nodes: Nodes

    def make(self) -> RayExecutor:
        return RayExecutor(threads=1, address=self.nodes.address)

    def test_the_doctor_looks_at_each_node(self, capsys: pytest.CaptureFixture[str]) -> None:
        self.nodes.complete()
        assert doctor.doctor([f"address={self.nodes.address}"]) == 0
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) == 3
        assert all("  ok  1 cores, 0 GPUs, " in line and "openeureka" in line for line in lines)

    def trained(
        self, folder: Path, disturb: Callable[[], object] = lambda: None, count: int = 2
    ) -> list[TrainingProgress | TrainingResult]:
        """Messages of a training. `disturb` is called once, when two lanes (or the only one) have left a snapshot.
        Until then no lane goes on, so that none is at its end."""
        trainer = RayExecutor(threads=1, address=self.nodes.address, snapshots=folder / "s", module="eager_worker")
        self.nodes.complete()
        lanes = [LaneSpec(id=str(seed), program="human", seed=seed) for seed in range(count)]
        messages: list[TrainingProgress | TrainingResult] = []
        disturbed = False
        with held(), pytest.MonkeyPatch.context() as patch:
            patch.setattr(retry, "SNAPSHOT_SECONDS", 1e-9)
            for message in trainer.train("cartpole", lanes, BRIEF):
                messages.append(message)
                if not disturbed and len(list((folder / "s").glob("*.pt"))) >= min(count, 2):
                    disturb()
                    disturbed = True
                    release()
        assert disturbed
        return messages

    @pytest.mark.parametrize("fault", ["worker", "node"])
    def test_what_a_fault_takes_is_trained_again_to_the_same_rows(
        self, fault: str, tmp_path: Path, undisturbed: list[TrainingResult]
    ) -> None:
        hurt: list[int] = []

        def disturb() -> None:
            at_work = {pid: raylet for pid, raylet in self.nodes.shares().items() if raylet in self.nodes.mortal}
            actor, raylet = next(iter(at_work.items()))
            hurt.extend([actor] if fault == "worker" else [raylet, actor])
            for pid in hurt:  # to Ray, a node that hangs is one that died, which it notices in another way
                os.kill(pid, signal.SIGKILL if fault == "worker" else signal.SIGSTOP)

        try:
            messages = self.trained(tmp_path, disturb, 3)
        finally:
            for pid in hurt if fault == "node" else ():
                os.kill(pid, signal.SIGKILL)
        results = [plain(message) for message in messages if isinstance(message, TrainingResult)]
        assert sorted(results, key=lambda result: result.lane) == undisturbed[:3]
        assert list(tmp_path.iterdir()) == []
        ((name, share),) = next(m for m in messages if isinstance(m, TrainingProgress)).nodes.items()
        assert name == platform.node() and share.lanes == 1 and share.env_steps_per_second > 0

    def test_a_node_that_joins_takes_what_waits(self, tmp_path: Path, undisturbed: list[TrainingResult]) -> None:
        joined: list[int] = []
        used: set[int] = set()

        def join() -> None:
            joined.append(self.nodes.join())
            while joined[0] not in self.nodes.shares().values():
                time.sleep(0.05)
            used.update(self.nodes.shares().values())

        results = [plain(m) for m in self.trained(tmp_path, join, 4) if isinstance(m, TrainingResult)]
        assert set(joined) <= used
        assert sorted(results, key=lambda result: result.lane) == undisturbed

    def test_a_worker_that_dies_by_itself_goes_on_from_its_snapshot(self, tmp_path: Path) -> None:
        lanes = [LaneSpec(id="a", program="human")]
        budget = TrainBudget(env_steps=16 * 32 * 3, worlds=32)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(retry, "SNAPSHOT_SECONDS", 1e-9)
            trainer = RayExecutor(
                threads=1, address=self.nodes.address, snapshots=tmp_path / "s", module="interrupted_worker"
            )
            (result,) = (m for m in trainer.train("cartpole", lanes, budget) if isinstance(m, TrainingResult))
        here = LocalExecutor(threads=1).train("cartpole", lanes, budget)
        assert plain(result) == plain(next(m for m in here if isinstance(m, TrainingResult)))

    def test_whoever_stops_listening_leaves_a_state_and_no_worker_behind(self, tmp_path: Path) -> None:
        trainer = RayExecutor(threads=1, address=self.nodes.address, snapshots=tmp_path / "s", module="eager_worker")
        self.nodes.complete()
        lanes = [LaneSpec(id="a", program="human")]
        training = trainer.train("cartpole", lanes, dataclasses.replace(BRIEF, env_steps=10**9))
        next(training)
        training.close()
        assert len(list((tmp_path / "s").glob("*.pt"))) == 1
        end = time.monotonic() + 300
        while (left := [*self.nodes.shares(), *workers()]) and time.monotonic() < end:
            time.sleep(0.1)
        assert not left

    def test_a_second_search_need_not_wait_for_the_end_of_the_first(self) -> None:
        self.nodes.complete()
        ended: list[str] = []

        def train(name: str, count: int) -> None:
            lanes = [LaneSpec(id=f"{name}-s{seed}", program="human", seed=seed) for seed in range(count)]
            trainer = RayExecutor(threads=1, address=self.nodes.address, module="eager_worker")
            messages = trainer.train("cartpole", lanes, BRIEF)
            ended.extend(name for message in messages if isinstance(message, TrainingResult))

        first = Thread(target=train, args=("first", 4))  # two rounds on three nodes
        second = Thread(target=train, args=("second", 1))
        with held():  # no lane ends before one is stopped
            first.start()
            while not (at_work := self.nodes.shares()):
                assert first.is_alive()
                time.sleep(0.1)
            stopped = next(iter(at_work))
            os.kill(stopped, signal.SIGSTOP)  # one lane of the first takes as long as the second search
        second.start()
        second.join()
        os.kill(stopped, signal.SIGCONT)
        first.join()
        assert ended[-1] == "first" and sorted(ended) == ["first"] * 4 + ["second"]

    def test_a_node_with_other_versions_is_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        here = ray_node.versions()
        monkeypatch.setattr(ray_node, "versions", lambda: {**here, "mujoco": "9.9"})
        said = rf"runs mujoco {here['mujoco']}, and this machine mujoco 9.9: install the same"
        with pytest.raises(ConfigError, match=said):
            list(self.make().train(self.env, self.lanes(), self.budget))


def plain(result: TrainingResult) -> TrainingResult:
    assert result.state is TrainingState.FINISHED, result.message
    return dataclasses.replace(result, seconds=0.0)


LAPTOP, BIG = Resources(cores=4), Resources(cores=64)


@pytest.mark.parametrize(
    ("offers", "lanes", "threads", "expected"),
    [
        ([LAPTOP], 2, 0, (2, 2)),  # both at once, two cores each
        ([LAPTOP], 18, 0, (4, 1)),  # one machine: as many shares as cores
        ([LAPTOP, BIG], 18, 0, (18, 3)),  # 1 + 21 places of three cores; of four cores, only 17
        ([LAPTOP, LAPTOP], 100, 0, (16, 1)),  # two rounds of eight
        ([Resources(cores=32)] * 8, 18, 0, (18, 10)),  # three places on each node
        ([LAPTOP, BIG], 100, 8, (8, 8)),  # the laptop has too few cores for a place
        ([LAPTOP], 5, 8, (0, 0)),
        ([Resources(cores=0)], 5, 0, (0, 0)),
        ([Resources(cores=1, memory=0.4e9 + 512 * 0.15e6)], 8, 0, (4, 1)),  # two lanes of 256 worlds fit
        (
            [Resources(cores=16, memory=5.6e9)],
            16,
            0,
            (8, 2),
        ),  # 16 would take 16 * (0.4 + 256 * 0.15e-3) = 7.0 GB
        ([Resources(cores=16, memory=5.6e9)], 16, 1, (16, 1)),  # threads=1 overrides what memory suggests
        ([Resources(cores=4, memory=0.4e9)], 8, 0, (8, 4)),  # too little memory for any: one by one
        ([Resources(cores=4, memory=0.4e9), BIG], 8, 0, (8, 8)),  # the small node takes none
    ],
)
def test_lanes_are_dealt_by_what_nodes_have(offers, lanes, threads, expected):
    assert shares(offers, lanes, 256, "cpu", threads) == expected


def test_a_gpu_takes_whole_populations():
    offers = [Resources(cores=16, gpus=2), Resources(cores=64)]
    assert shares(offers, 18, 4096, "cuda", 0) == (2, 1)
    assert shares(offers, 40, 4096, "cuda", 0) == (3, 1)  # 16 lanes fill the worlds of one
    assert shares([LAPTOP], 18, 4096, "cuda", 0) == (0, 0)
    assert shares([Resources(cores=0, gpus=8)], 18, 4096, "cuda", 0) == (0, 0)  # an actor needs a core, too
    assert shares([Resources(cores=3, gpus=8)], 18, 4096, "cuda", 16) == (3, 16)


def test_a_cluster_that_takes_orders_from_anybody_is_refused():
    node = {"host": "far", "token": False, "versions": ray_node.versions()}
    check(node, guarded=False)
    with pytest.raises(ConfigError, match=r"RAY_AUTH_MODE=token"):
        check(node, guarded=True)
    check({**node, "token": True}, guarded=True)


def test_a_device_of_one_machine_is_refused():
    with pytest.raises(ConfigError, match="On a cluster, device= takes cpu or cuda, not `cuda:1`"):
        RayExecutor("cuda:1")


def test_where_ray_is_missing_the_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ConfigError, match=r"pip install 'openeureka\[ray\]'"):
        RayExecutor(address="local")


def test_where_a_cluster_refuses_the_token_the_sentence_names_the_variable(monkeypatch: pytest.MonkeyPatch):
    def refused(**_: object) -> None:
        raise ConnectionError("Failed to connect to Ray cluster at 10.0.0.1:6379")

    ray = SimpleNamespace(
        is_initialized=lambda: False,
        init=refused,
        exceptions=SimpleNamespace(RayError=type("RayError", (Exception,), {})),
    )
    monkeypatch.setitem(sys.modules, "ray", ray)
    with pytest.raises(
        ConfigError, match=r"no cluster to join at address=10\.0\.0\.1:6379 .*set RAY_AUTH_TOKEN to the token"
    ):
        RayExecutor(address="10.0.0.1:6379")


def test_it_is_found_by_its_name():
    assert EXECUTORS.find("ray") is RayExecutor


def test_what_runs_on_a_node_imports_neither_torch_nor_ray_by_itself():
    code = "import sys, openeureka.executors.ray_node; print({'torch', 'ray', 'mujoco'} & sys.modules.keys())"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"
