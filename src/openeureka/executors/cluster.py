"""A Ray cluster: how this machine joins it, what its nodes have, and how many lanes they have room for."""

from __future__ import annotations

import ipaddress
import math
import os
import signal
import threading
import time
from collections.abc import Collection, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from ..errors import ConfigError
from . import ray_node
from .local import MAX_WORLDS

WORKER, WORLD = 0.4e9, 0.15e6
"""[bytes] of memory that a worker takes, and each of its worlds."""
ROUNDS = 2
"""Populations per place of several machines: quick machines take more of them, and one that joins finds some left."""
FULL = 8
"""Lanes per place below which a second round costs more than it gains: small populations train slowly."""
OBJECT_STORE = 200 << 20
"""[bytes] of Ray's object store on a cluster of this machine alone; frames stay there until they are read."""
ANSWER = 60.0
"""[s] that a node may take to say what it has: it starts a process for that."""
_SETTINGS = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_DEDUP_LOGS_SKIP_REGEX": ".*",  # the cluster logs to its files, not into the middle of a table
    "RAY_NUM_REDIS_GET_RETRIES": "1",  # an address where nobody answers is given up in less than a minute
}


@dataclass(frozen=True, slots=True)
class Resources:
    """What a node offers, or a worker needs."""

    cores: int
    gpus: int = 0
    memory: float = math.inf
    """[bytes]"""

    def within(self, other: Resources) -> bool:
        """Whether the other has as many cores and GPUs."""
        return self.cores <= other.cores and self.gpus <= other.gpus

    @staticmethod
    def of(node: Mapping[str, Any]) -> Resources:
        has = node["Resources"]
        return Resources(int(has.get("CPU", 0)), int(has.get("GPU", 0)), has.get("memory", math.inf))


_joined = ""
"""The `address=` by which `connect` joined a cluster; empty if it joined none, or the process was in one before."""


def connect(address: str) -> Any:
    """Join the cluster, and return the module `ray`. A process belongs to one cluster for as long as it lives.

    Raises:
        ConfigError: when there is no such cluster, Ray is missing or of another version, this process belongs to
            another cluster, or the cluster takes orders from anybody.
    """
    global _joined
    ray = _imported(address)
    if ray.is_initialized():
        if address not in (_joined or address, ray.get_runtime_context().gcs_address):
            raise ConfigError(f"This Python has joined the cluster at address={_joined}: restart it to join {address}.")
    else:
        options: dict[str, Any] = {"include_dashboard": False, "object_store_memory": OBJECT_STORE}
        options = options if address == "local" else {}
        try:
            with _sigterm_kept():
                ray.init(address=address or "auto", log_to_driver=False, logging_level="ERROR", **options)
        except (ray.exceptions.RayError, ConnectionError, RuntimeError, ValueError) as error:
            said = " ".join(str(error).split())[:300]
            raise ConfigError(
                f"There is no cluster to join at address={address} ({said}); start one with `ray start --head`, set "
                "RAY_AUTH_TOKEN to the token that it was started with, or write address=local."
            ) from None
        _joined = address
    if exposed(ray) and os.environ.get("RAY_AUTH_MODE", "").lower() != "token":
        raise _open(ray.get_runtime_context().gcs_address)
    return ray


@contextmanager
def _sigterm_kept() -> Generator[None]:
    """Keep the handler of SIGTERM: Ray's own ends this process at once, and no training would leave its state."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        yield
    finally:
        if callable(before) and threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, before)


def _imported(address: str) -> Any:
    for name, value in _SETTINGS.items():
        os.environ.setdefault(name, value)
    if address == "local":
        os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "0")  # Ray's word for: listen on loopback alone
    try:
        import ray
    except ImportError:
        raise ConfigError("executor=ray needs Ray, which is not installed: pip install 'openeureka[ray]'.") from None
    return ray


def exposed(ray: Any) -> bool:
    """Whether the cluster listens beyond this machine, so that it must ask for a token."""
    host = ray.get_runtime_context().gcs_address.rpartition(":")[0].strip("[]")
    try:
        return not ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host != "localhost"


def _open(where: str) -> ConfigError:
    return ConfigError(
        f"The cluster at {where} runs code from anybody on its network: run `ray get-auth-token --generate` once, "
        "copy ~/.ray/auth_token to every node, and start Ray and eureka with the environment variable "
        "RAY_AUTH_MODE=token."
    )


def living(ray: Any, without: Collection[str]) -> list[Resources]:
    """What each living node offers, except for the nodes of these ids."""
    return [Resources.of(node) for node in ray.nodes() if node["Alive"] and node["NodeID"] not in without]


def shares(offers: Sequence[Resources], lanes: int, worlds: int, device: str, threads: int) -> tuple[int, int]:
    """Into how many populations to deal lanes, and the cores of each; (0, 0) where no node has room for one.

    A population gets the most cores with which the cluster still has a place for each lane, or as many places as it can
    have. The memory of a place, its part of the node's, must hold a worker and one lane, and a population has no more
    worlds than its place holds. On a GPU it takes one core.
    """
    if device == "cuda":
        threads, places, memory = max(1, threads), sum(min(offer.gpus, offer.cores) for offer in offers), math.inf
    else:
        threads = threads or _cores_of_each(offers, lanes, WORKER + worlds * WORLD)
        used = [offer for offer in offers if offer.cores >= threads > 0]
        places, memory = _places(used, threads), _memory(used, threads)
        if len(used) > 1 and lanes >= places * FULL:
            places *= ROUNDS
    if not places:
        return 0, 0
    most_worlds = min(MAX_WORLDS[device], max(0.0, memory - WORKER) // WORLD)
    return max(min(places, lanes), math.ceil(lanes / max(1, most_worlds // worlds))), threads


def _cores_of_each(offers: Sequence[Resources], lanes: int, memory: float) -> int:
    """The cores of a population, see `shares`, where each needs so much memory [bytes]; 0 where no node has a core."""
    numbers = range(max((offer.cores for offer in offers), default=0), 0, -1)
    # Memory is an estimate: where no part seems large enough, the fewest populations side by side are tried.
    roomy = [number for number in numbers if _memory(offers, number) >= memory] or numbers[:1]
    places = {number: _places(offers, number) for number in roomy}
    wanted = min(lanes, max(places.values(), default=0))
    return next((number for number, count in places.items() if count >= wanted), 0)


def _places(offers: Sequence[Resources], cores: int) -> int:
    """How many populations of so many cores there is room for at once."""
    return sum(offer.cores // cores for offer in offers)


def _memory(offers: Sequence[Resources], cores: int) -> float:
    """[bytes] The smallest part of a node's memory that a place of so many cores has; 0 where there is no place."""
    return min((offer.memory / (offer.cores // cores) for offer in offers if offer.cores >= cores), default=0.0)


class UnlikeNode(ConfigError):
    """A node would compute other numbers than this machine."""


def check(node: Mapping[str, Any], *, guarded: bool, device: str = "cpu", env: str = "") -> None:
    """Refuse a node whose numbers would differ from this machine's, or that takes orders from anybody.

    Args:
        env: the task; its file, if it has one, must be the same.

    Raises:
        UnlikeNode: when versions or the file differ; it says what runs where.
        ConfigError: when anybody may give it orders.
    """
    if guarded and not node["token"]:
        raise _open(node["host"])
    here, there = ray_node.versions(), node["versions"]
    # A machine that only searches need not have the packages for GPUs.
    without = [name for name in ray_node.ON_GPUS if device != "cuda" or here[name] == "none"]
    if odd := [name for name, number in here.items() if name not in without and there.get(name) != number]:
        theirs = ", ".join(f"{name} {there.get(name, 'none')}" for name in odd)
        ours = ", ".join(f"{name} {here[name]}" for name in odd)
        raise UnlikeNode(f"Node {node['host']} runs {theirs}, and this machine {ours}: install the same on both.")
    if (own := ray_node.task_digest(env)) and own != node.get("task"):
        raise UnlikeNode(
            f"Node {node['host']} lacks {env}, or its file of that name differs: copy this machine's file there."
        )


def lacking(error: Exception) -> ConfigError | None:
    """What to tell a person if a node raised this error because it lacks a package; None for any other error."""
    if "ModuleNotFoundError" not in str(error):
        return None
    return ConfigError(
        "A node of the cluster lacks openeureka or a package that it needs: run pip install "
        f"'openeureka[ray]=={ray_node.versions()['openeureka']}' there, or install your task's own package."
    )


def survey(address: str) -> list[dict[str, Any]]:
    """What each node of a cluster has: `ray_node.about`, its `cores` and `gpus`, and the `offset` [s] of its clock. A
    node that does not answer has its `host` and a `fault`, in a sentence."""
    ray = connect(address)
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    asked: Any = ray.remote(ray_node.about)
    found: list[dict[str, Any]] = []
    for node in ray.nodes():
        if not node["Alive"]:
            continue
        place = NodeAffinitySchedulingStrategy(node["NodeID"], soft=False)
        said: dict[str, Any] = {}
        try:
            for _ in range(2):  # the first starts a process there, which takes a second
                asked_at = time.time()
                said = ray.get(asked.options(num_cpus=0, scheduling_strategy=place).remote(), timeout=ANSWER)
                said["offset"] = said["time"] - (asked_at + time.time()) / 2
        except ray.exceptions.RayError as error:
            fault = (
                lacking(error)
                or f"It did not report what it has: {(str(error).splitlines() or ['no answer'])[-1]:.300}"
            )
            found.append({"host": node["NodeManagerHostname"], "fault": str(fault)})
            continue
        offered = Resources.of(node)
        found.append({**said, "cores": offered.cores, "gpus": offered.gpus, "guarded": exposed(ray)})
    return found
