"""Lanes on the machines of a Ray cluster: one actor per population, wherever Ray finds the cores or the GPU for it.

Ray places actors, and reports which have died. This machine holds the store, so it decides what is tried again, and
from which snapshot. Frames travel as bytes.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Generator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import ConfigError, TaskError, WorkerError
from ..tasks import registry
from ..types import LaneSpec, TrainBudget, TrainingEvent
from ..worker import LESS_MEMORY, Frame, WorkerDied, framed, unframed
from . import cluster, ray_node, retry, scheduler
from .cluster import Resources
from .local import MAX_WORLDS
from .retry import Errand
from .transport import SILENCE, Seat, WorkerLost

POLL = 1.0
"""[s] between two looks at silent calls; Ctrl-C is heard between them."""

_log = logging.getLogger(__name__)


class RayExecutor(retry.Questions):
    """A `types.Trainer` that deals lanes by what the nodes of a cluster have.

    Args:
        device: `cpu` or `cuda`: a population takes cores, or one whole GPU.
        threads: cores of each population; 0 for as many as leave room for all populations at once, and for fewer when
            no node with so many is left.
        snapshots: see `local.LocalExecutor`.
        address: `auto` for the cluster that this machine is part of, `HOST:PORT`, or `local` for one of its own.
        module: what a worker runs; tests replace it.
        silence: [s] after which a worker that says nothing is ended and replaced. Ray notices a machine that hangs.

    Raises:
        ConfigError: when Ray is not installed, there is no such cluster, or it takes orders from anybody.
    """

    def __init__(
        self,
        device: str = "cpu",
        threads: int = 0,
        *,
        snapshots: Path | None = None,
        address: str = "auto",
        module: str = "openeureka.executors.child",
        silence: float = SILENCE,
    ) -> None:
        if device not in MAX_WORLDS:
            raise ConfigError(f"On a cluster, device= takes {' or '.join(MAX_WORLDS)}, not `{device}`.")
        self._device, self._threads, self._snapshots, self._address = device, threads, snapshots, address
        self._ray = cluster.connect(address)
        self._actors = Actors(self._ray, module, silence, exact=threads > 0)
        # Questions are brief: they wait for one core of a node, and use the other cores as far as these are idle. Where
        # several searches share a cluster, waiting for a whole node may take for ever.
        super().__init__(self._actors, Seat("cuda:0" if device == "cuda" else "cpu", threads))
        self._had_room = False

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> Generator[TrainingEvent]:
        """Train every lane, as `local.LocalExecutor.train` does, as soon as a node has room.

        Raises:
            ConfigError: when no node has had what `device=` and `threads=` ask for, or those that have it run other
                versions.
            TaskError, WorkerError: as `local.LocalExecutor.train` does.
        """
        worlds = budget.worlds or registry.get(env).recipe.worlds
        count, threads = self._shares(len(lanes), worlds)
        dealt = scheduler.deal(lanes, retry.together(self._snapshots, env, budget, self._device), count)
        errands = [Errand(env, share, budget, self._snapshots) for share in dealt]
        # All are submitted at once: Ray knows best when there is room for the next.
        return scheduler.train(self._transport, errands, [self._seat._replace(threads=threads)] * len(errands))

    def _shares(self, lanes: int, worlds: int) -> tuple[int, int]:
        """See `cluster.shares`. Waits for room, if the cluster had some before or has neither cores nor GPUs yet."""
        while True:
            offers = self._actors.offers()
            count, threads = cluster.shares(offers, lanes, worlds, self._device, self._threads)
            if count:
                self._actors.tell(waiting=False)
                self._had_room = True
                return count, threads
            if not self._had_room and any(offer.cores or offer.gpus for offer in offers):
                asked = f"device={self._device}" + (f" threads={self._threads}" if self._threads else "")
                raise ConfigError(f"No node of the cluster at address={self._address} has room for {asked}.")
            self._actors.tell(waiting=True)
            time.sleep(POLL)


class Actors:
    """A `Transport` that serves each call by its own actor.

    Args:
        exact: a call waits for as many cores as its seat has, even while no node has so many.
    """

    def __init__(self, ray: Any, module: str, silence: float, *, exact: bool) -> None:
        self._ray, self._module, self._silence, self._exact = ray, module, silence, exact
        self._looked, self._told = -math.inf, False
        self._actor: Any = ray.remote(ray_node.Share)
        self._guarded = cluster.exposed(ray)
        self._unlike = set[str]()
        """Ids of nodes whose numbers would differ."""
        self._shunned = set[str]()
        """The id of the node that the next call avoids, if another node has what it needs."""

    def offers(self) -> list[Resources]:
        """What each node offers on which actors may run."""
        return cluster.living(self._ray, self._unlike)

    def call(self, request: Frame, seat: Seat) -> ActorCall:
        gpus = int(seat.device.startswith("cuda"))
        if not gpus and not self._exact:  # the nodes that had so many may be gone
            most = max((offer.cores for offer in self.offers()), default=0)
            seat = seat._replace(threads=min(seat.threads, most or seat.threads))
        needs = Resources(1 if gpus else max(1, seat.threads), gpus)
        away, self._shunned = self._unlike | self._shunned, set()
        if away != self._unlike and not any(needs.within(offer) for offer in cluster.living(self._ray, away)):
            away = self._unlike
        apart = {"label_selector": {"ray.io/node-id": f"!in({','.join(away)})"}} if away else {}
        actor = self._actor.options(
            num_cpus=needs.cores,
            num_gpus=needs.gpus,
            max_restarts=0,
            max_concurrency=2,  # `stop` is heard while `serve` is under way
            scheduling_strategy="SPREAD",
            **apart,
        ).remote(self._module)
        data = framed(request.header, request.blobs)
        serve = actor.serve.options(num_returns="streaming", max_task_retries=0)
        stream = serve.remote(data, *seat)
        return ActorCall(self, self._ray, actor, stream, needs, self._silence, env=request.header["env"])

    def admit(self, node: Mapping[str, Any], needs: Resources, env: str) -> None:
        """Check a node that has begun to serve a call.

        Raises:
            WorkerLost: when its numbers would differ: no further call goes there.
            ConfigError: when they would and no other node has what the call needs, or anybody may give it orders.
        """
        try:
            cluster.check(node, guarded=self._guarded, device="cuda" if needs.gpus else "cpu", env=env)
        except cluster.UnlikeNode as error:
            known = node["id"] in self._unlike
            self._unlike.add(node["id"])
            if not any(needs.within(offer) for offer in self.offers()):
                raise
            if not known:
                _log.warning("%s Until then only the other nodes train.", error)
            raise WorkerLost("Training stopped: the node that was to train runs other versions.") from None

    def shun(self, node: str) -> None:
        """Let the next call, which repeats what failed there, avoid this node: its GPU may be faulty, for instance."""
        self._shunned = {node}

    def wait(self, calls: Sequence[ActorCall], timeout: float | None = None) -> Sequence[ActorCall]:
        end = math.inf if timeout is None else time.monotonic() + timeout
        by_stream = {call.stream: call for call in calls}
        streams = list(by_stream)
        while calls:
            self._look(calls)
            left = min([end - time.monotonic(), *(call.patience for call in calls)])
            ready, _ = self._ray.wait(streams, num_returns=1, timeout=max(0.0, min(left, POLL)))
            if ready:
                ready, _ = self._ray.wait(streams, num_returns=len(streams), timeout=0)
            found = [call for call in calls if call.patience <= 0]
            found += [call for stream in ready if (call := by_stream[stream]) not in found]
            if found or left <= 0:
                return found
        return []

    def _look(self, calls: Sequence[ActorCall]) -> None:
        """Now and then, give up calls that wait for more cores than any node has: they are made again with fewer."""
        waiting = [call for call in calls if call.waiting]
        if not waiting or time.monotonic() - self._looked < POLL:
            return
        self._looked, offers = time.monotonic(), self.offers()
        vain = [call for call in waiting if not any(call.needs.within(offer) for offer in offers)]
        for call in vain:
            call.lost = not self._exact and not call.needs.gpus and any(offer.cores for offer in offers)
        self.tell(waiting=len(vain) == len(calls) and not any(call.lost for call in vain))

    def tell(self, *, waiting: bool) -> None:
        """Warn once while all calls wait for a node; nothing else tells it."""
        if waiting and not self._told:
            _log.warning("No node of the cluster has room: waiting for one. Ctrl-C stops the run; nothing is lost.")
        self._told = waiting


class ActorCall:
    """A `Call` that an actor serves, as soon as there is room for it."""

    def __init__(
        self, transport: Actors, ray: Any, actor: Any, stream: Any, needs: Resources, silence: float, *, env: str
    ) -> None:
        self._transport, self._ray, self._actor = transport, ray, actor
        self.stream, self.needs, self.lost = stream, needs, False
        self._silence, self._env = silence, env
        self._heard = math.inf  # an actor may wait for a place as long as it takes
        self._node: Mapping[str, Any] = {}
        self._reported = False

    @property
    def waiting(self) -> bool:
        """Whether it has no place yet."""
        return self._heard == math.inf

    @property
    def patience(self) -> float:
        """[s] that the actor may still be silent."""
        return 0.0 if self.lost else self._heard + self._silence - time.monotonic()

    def receive(self) -> Frame:
        self._transport.wait([self])  # `next` would wait for ever
        if not self._ray.wait([self.stream], timeout=0)[0]:  # a frame that is there is read, however late
            if self.lost:
                raise WorkerLost("Training stopped: no node is left that has the cores it waited for.")
            raise self._died("Training stopped: The worker process did not answer in time.")
        try:
            frame = unframed(self._ray.get(next(self.stream), timeout=self._silence))
        except (self._ray.exceptions.RayError, StopIteration, WorkerDied) as error:
            raise self._ending(error) from None
        self._heard, header = time.monotonic(), frame.header
        if "node" in header:
            self._node = header["node"]
            self._transport.admit(self._node, self.needs, self._env)
            return Frame({})
        if "died" in header:
            raise self._died(f"{header['died']} That was on {self._node['host']}.")
        if "broken" in header:
            raise TaskError(f"{header['broken']} That was on {self._node['host']}.")
        if "progress" in header:
            self._reported = True
            return Frame({"progress": self._placed(header["progress"])})
        return frame

    def _placed(self, progress: Mapping[str, Any]) -> dict[str, Any]:
        share = {"lanes": len(progress["fitness"]), "env_steps_per_second": progress["env_steps_per_second"]}
        return {**progress, "nodes": {self._node["host"]: share}}

    def _ending(self, error: Exception) -> WorkerError | ConfigError:
        """The error to raise for an actor that is gone."""
        if getattr(error, "actor_init_failed", False) or isinstance(error, self._ray.exceptions.RayTaskError):
            return cluster.lacking(error) or WorkerError(f"Training stopped: {str(error).splitlines()[-1]}")
        alive = {node["NodeID"] for node in self._ray.nodes() if node["Alive"]}
        if self._node.get("id") not in alive:  # also if it never said where it is: it had not begun
            return WorkerLost("Training stopped: the node that trained is gone.")
        return self._died(
            f"Training stopped: the Ray worker on {self._node['host']} ended before it answered; Ray ends one also "
            f"where memory runs out: {LESS_MEMORY}."
        )

    def _died(self, said: str) -> WorkerError:
        """The error of a dead worker. If it never reported, the retry avoids its node, which may be at fault."""
        if self._node and not self._reported:
            self._transport.shun(self._node["id"])
        return WorkerError(said)

    def stop(self) -> None:
        self._actor.stop.remote()

    def close(self) -> None:
        with suppress(self._ray.exceptions.RayError):
            self._ray.kill(self._actor)
