"""What a Ray cluster costs and gains: raylets on this machine, a core each.

    python benchmarks/cluster.py                      # all parts; half an hour on a quiet machine
    python benchmarks/cluster.py --part scale         # 10,000 lanes on 200 slots, which only sleep and report
    python benchmarks/cluster.py --tiny               # whether it runs

Each part is written when it is done. Wall times can be compared only within a part, and only on a quiet machine.
`faults` compares rows to the bit; in `scale` the driver's CPU time counts.
"""

from __future__ import annotations

import dataclasses
import json
import os
import resource
import secrets
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# Before Ray is loaded: on loopback alone, with a token, silent.
os.environ |= {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_DEDUP_LOGS_SKIP_REGEX": ".*",
    "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0",
    "RAY_AUTH_MODE": "token",
    "RAY_AUTH_TOKEN": os.environ.get("RAY_AUTH_TOKEN") or secrets.token_hex(32),
}

from records import command_line, conditions, keep, results

from openeureka.executors import ray_node, retry, scheduler
from openeureka.executors.cluster import Resources
from openeureka.executors.local import LocalExecutor
from openeureka.executors.ray import ActorCall, Actors, RayExecutor
from openeureka.executors.retry import Errand
from openeureka.executors.transport import SILENCE, Seat, WorkerLost
from openeureka.training.wire import pack, unpack_lanes
from openeureka.types import (
    LaneSpec,
    TrainBudget,
    Trainer,
    TrainingEvent,
    TrainingProgress,
    TrainingResult,
    TrainingState,
)
from openeureka.worker import Frame, framed, unframed

RESULTS = results("cluster")
NODE = {"num_cpus": 1, "object_store_memory": 100 << 20, "node_ip_address": "127.0.0.1", "include_dashboard": False}
SYSTEM = {"worker_niceness": 0}
"""Workers of a cluster get the same priority on this machine as local ones."""
ENV = "ant"
SLOTS, HOSTS, DYING, LANES, TOGETHER = 200, 20, 2, 10_000, 5
"""For `scale`: slots, the processes that they share, those of them that are killed, lanes, lanes of a population."""


@contextmanager
def cluster(nodes: int, **head: object) -> Iterator[Any]:
    """Raylets of one core each."""
    import ray
    from ray.cluster_utils import Cluster

    made = Cluster(initialize_head=True, head_node_args={**NODE, **head, "_system_config": SYSTEM})
    try:
        for _ in range(nodes - 1):
            made.add_node(**NODE)
        yield made
    finally:
        ray.shutdown()
        made.shutdown()


def lanes(count: int) -> list[LaneSpec]:
    return [LaneSpec(id=f"human-s{seed}", program="human", seed=seed) for seed in range(count)]


def timed(
    trainer: Trainer, count: int, budget: TrainBudget, each: Callable[[object], object] = id
) -> tuple[float, Any]:
    """Seconds of a training, and its results by lane."""
    begun, rows = time.monotonic(), {}
    for message in trainer.train(ENV, lanes(count), budget):
        each(message)
        if isinstance(message, TrainingResult):
            rows[message.lane] = dataclasses.replace(message, seconds=0.0)
    return time.monotonic() - begun, rows


def overhead(tiny: bool) -> dict[str, object]:
    """Train the same lanes on a core here and on a core of a cluster, in turn."""
    budget = TrainBudget(env_steps=20_000 if tiny else 1_000_000, worlds=256)
    here: list[float] = []
    there: list[float] = []
    with cluster(1) as made:
        far, near = RayExecutor(threads=1, address=made.address), LocalExecutor(threads=1)
        for _ in range(1 if tiny else 3):
            seconds, rows = timed(near, 2, budget)
            here.append(round(seconds, 1))
            seconds, same = timed(far, 2, budget)
            there.append(round(seconds, 1))
            assert rows == same
    return {"local_s": here, "ray_s": there, "ratio": round(sum(there) / sum(here), 3), "same_rows": True}


def scaling(tiny: bool) -> dict[str, object]:
    """Train the same lanes on one node of a core, then on two; for minutes, as starts count. The same on one and two
    workers without Ray shows what the machine itself gains."""
    budget = TrainBudget(env_steps=20_000 if tiny else 1_000_000, worlds=256)
    here, halved = (timed(LocalExecutor(threads=threads), 4, budget)[0] for threads in (1, 2))
    with cluster(1) as made:
        far = RayExecutor(threads=1, address=made.address)
        one, _ = timed(far, 4, budget)
        made.add_node(**NODE)
        two, _ = timed(far, 4, budget)
    return {
        "one_node_s": round(one, 1),
        "two_nodes_s": round(two, 1),
        "speedup": round(one / two, 2),
        "one_worker_s": round(here, 1),
        "two_workers_s": round(halved, 1),
        "speedup_of_workers": round(here / halved, 2),
    }


def faults(tiny: bool) -> dict[str, object]:
    """What each fault costs compared with an undisturbed training, with a snapshot every few seconds."""
    retry.SNAPSHOT_SECONDS = 1.0 if tiny else 5.0
    budget = TrainBudget(env_steps=60_000 if tiny else 200_000, worlds=256)
    found: dict[str, object] = {"snapshot_every_s": retry.SNAPSHOT_SECONDS}
    with cluster(2) as made, tempfile.TemporaryDirectory() as folder:
        found["health_check"] = "as Ray sets it"

        def train(name: str, disturb: Callable[[], object]) -> tuple[float, Any]:
            snapshots = Path(folder) / name
            far = RayExecutor(threads=1, address=made.address, snapshots=snapshots)
            done: list[object] = []

            def each(_: object) -> None:
                if not done and len(list(snapshots.glob("*.pt"))) == 2:
                    done.append(True)
                    disturb()

            timing = timed(far, 2, budget, each)
            assert done, "it was over before it was disturbed"
            return timing

        def hurt(raylet: bool, number: signal.Signals) -> None:
            """Send a signal to an actor of a node other than the head and, with `raylet`, to its raylet."""
            parents = {node.all_processes["raylet"][0].process.pid for node in made.worker_nodes}
            actor, parent = next((pid, parent) for pid, parent in actors().items() if parent in parents)
            for pid in (parent, actor) if raylet else (actor,):
                os.kill(pid, number)

        def fill() -> None:
            import ray

            held.extend(ray.put(os.urandom(10 << 20)) for _ in range(12))

        held: list[object] = []
        undisturbed, rows = train("nothing", lambda: None)
        found["nothing"] = {"seconds": round(undisturbed, 1)}
        for name, disturb in {
            "kill -9 of a worker": lambda: hurt(False, signal.SIGKILL),
            "a full object store": fill,
            "a node joins": lambda: made.add_node(**NODE),
            "kill -9 of a raylet": lambda: hurt(True, signal.SIGKILL),
            "a node hangs (SIGSTOP)": lambda: hurt(True, signal.SIGSTOP),
        }.items():
            if len(made.worker_nodes) == 0 or not alive(made):
                made.add_node(**NODE)
            seconds, same = train(name, disturb)
            held.clear()
            found[name] = {
                "seconds": round(seconds, 1),
                "cost_s": round(seconds - undisturbed, 1),
                "same_rows": same == rows,
            }
            print(name, found[name], flush=True)
        for pid in actors():
            os.kill(pid, signal.SIGKILL)  # the one that hangs
        found["kill -9 of the driver"] = driver(made.address, Path(folder))
    return found


def alive(made: Any) -> bool:
    """Whether a node besides the head is alive."""
    import ray

    return not ray.is_initialized() or sum(node["Alive"] for node in ray.nodes()) > 1


def actors() -> dict[int, int]:
    """Pid of each actor that trains -> pid of its raylet."""
    found: dict[int, int] = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if (folder / "cmdline").read_bytes().startswith(b"ray::Share.serve"):
                found[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:  # it ended
            continue
    return found


def driver(address: str, folder: Path) -> dict[str, object]:
    """`eureka train` killed in the middle, and typed again: it should store what an undisturbed one stores."""

    def words(name: str) -> list[str]:
        settings = ["env=cartpole", "reward=human", "seeds=2", "steps=400000"]
        return [*settings, "threads=1", "executor=ray", f"address={address}", f"dir={folder / name}"]

    code = "from openeureka.executors import retry; retry.SNAPSHOT_SECONDS = 1.0; "
    code += "from openeureka.cli.main import main; main()"

    def start(name: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen([sys.executable, "-P", "-c", code, "train", *words(name)], stdout=subprocess.DEVNULL)

    begun = time.monotonic()
    assert start("whole").wait() == 0
    undisturbed, begun = time.monotonic() - begun, time.monotonic()
    first = start("killed")
    while not list((folder / "killed" / "snapshots").glob("*.pt")):
        assert first.poll() is None, "it was over before it was killed"
        time.sleep(0.05)
    first.kill()
    first.wait()
    assert start("killed").wait() == 0
    seconds = time.monotonic() - begun
    same = curves(folder / "whole") == curves(folder / "killed")
    return {"seconds": round(seconds, 1), "cost_s": round(seconds - undisturbed, 1), "same_rows": same}


def curves(directory: Path) -> dict[str, object]:
    """Row and curves of every lane that a run stores, without the time that it took."""
    from openeureka import open_run

    found = open_run(directory).lanes.items()
    return {name: (lane.row() | {"seconds": 0.0}, dict(lane.curves)) for name, lane in found}


class Sleeper:
    """Stands in for `ray_node.Share`: trains nothing, but reports progress for some seconds."""

    def serve(self, request: bytes, device: str, threads: int, seconds: float) -> Iterator[bytes]:
        yield framed({"node": ray_node.about()})
        specs = unpack_lanes(unframed(request))[1]
        end, epoch = time.monotonic() + seconds, 0
        while time.monotonic() < end:
            time.sleep(1.0)
            epoch += 1
            fitness = {spec.id: float(epoch) for spec in specs}
            yield told(TrainingProgress(epoch=epoch, epochs=int(seconds), env_steps_per_second=1.0, fitness=fitness))
        for spec in specs:
            curve = tuple(map(float, range(200)))
            done = {"fitness": 1.0, "curves": {"fitness": curve, "reward": curve}, "env_steps": 1, "seconds": seconds}
            yield told(TrainingResult(lane=spec.id, state=TrainingState.FINISHED, **done))
        yield framed({"done": True})


def told(message: TrainingEvent) -> bytes:
    frame = pack(message)
    return framed(frame.header, frame.blobs)


class Hosted(ActorCall):
    """One of the slots that share a process: it does not end the process, and is not blamed for the process's death."""

    def _ending(self, error: Exception) -> WorkerLost:
        return WorkerLost(str(error))

    def close(self) -> None: ...


class Hosts(Actors):
    """Many slots on few processes: 200 processes would fill this machine's memory."""

    def __init__(self, ray: Any, seconds: float) -> None:
        super().__init__(ray, "", SILENCE, exact=True)
        self.seconds = seconds
        place = ray.remote(Sleeper).options(num_cpus=0, max_concurrency=2 * SLOTS // HOSTS)
        self.alive = deque(place.remote() for _ in range(HOSTS))

    def call(self, request: Frame, seat: Seat) -> Hosted:
        self.alive.rotate(-1)
        host, data = self.alive[0], framed(request.header, request.blobs)
        stream = host.serve.options(num_returns="streaming").remote(data, *seat, self.seconds)
        return Hosted(self, self._ray, host, stream, Resources(1), SILENCE, env=request.header["env"])

    def kill(self, count: int) -> None:
        for _ in range(count):
            self._ray.kill(self.alive.pop())


def scale(tiny: bool) -> dict[str, object]:
    """10,000 lanes on 200 slots, of which a tenth die on the way."""
    count = LANES // 20 if tiny else LANES
    with cluster(1) as made:
        ray = RayExecutor(threads=1, address=made.address)._ray
        hosts = Hosts(ray, 5.0)
        specs = lanes(count)
        errands = [Errand("cartpole", specs[at : at + TOGETHER], TrainBudget(), None)
                       for at in range(0, count, TOGETHER)]  # fmt: skip
        begun, cpu = time.monotonic(), time.process_time()
        results: list[str] = []
        messages = 0
        for message in scheduler.train(hosts, errands, [Seat("cpu", 1)] * SLOTS):
            messages += 1
            if isinstance(message, TrainingResult) and message.state is TrainingState.FINISHED:
                results.append(message.lane)
            if len(hosts.alive) == HOSTS and len(results) > count // 4:
                hosts.kill(DYING)
        seconds, spent = time.monotonic() - begun, time.process_time() - cpu
    assert sorted(results) == sorted(spec.id for spec in specs), "a lane has no result, or two"
    return {
        "lanes": count,
        "slots": SLOTS,
        "slots_that_died": DYING * SLOTS // HOSTS,
        "results": len(results),
        "messages": messages,
        "seconds": round(seconds, 1),
        "driver_cpu_s": round(spent, 1),
        "driver_cores": round(spent / seconds, 3),
        "driver_peak_gb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20, 2),
    }


PARTS: dict[str, Callable[[bool], dict[str, object]]] = {
    "overhead": overhead,
    "scaling": scaling,
    "faults": faults,
    "scale": scale,
}


TITLES = ("what happens in a training", "seconds", "more than undisturbed", "same rows")


def costs(measured: dict[str, Any]) -> list[tuple[str, ...]]:
    """One row per fault: how long a training of two lanes took with it."""
    parts = {name: part for name, part in measured["faults"].items() if isinstance(part, dict) and "seconds" in part}
    rows = [
        (name, part["seconds"], part.get("cost_s", 0.0), part.get("same_rows", True)) for name, part in parts.items()
    ]
    return [(name, f"{whole:.0f}", f"{cost:.0f}", "yes" if same else "NO") for name, whole, cost, same in rows]


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--part", choices=PARTS, action="append")
    parser.add_argument("--tiny", action="store_true", help="whether it runs; writes nothing")
    args = parser.parse_args()
    for name in args.part or PARTS:
        found = PARTS[name](args.tiny)
        found |= conditions("ray")
        print(name, json.dumps(found, indent=1), flush=True)
        if not args.tiny:
            keep(RESULTS, name, found)


if __name__ == "__main__":
    main()
