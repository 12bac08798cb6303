"""Deals lanes into populations, and populations to workers: which of them wait, which is next, how far all are."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..types import LaneSpec, NodeShare, TrainingEvent, TrainingProgress, TrainingResult
from ..worker import Frame
from .retry import Errand
from .transport import AnyCall, Seat, Transport, farewell


def deal(lanes: Sequence[LaneSpec], kept: Sequence[Sequence[str]], count: int) -> list[Sequence[LaneSpec]]:
    """Lanes dealt into about `count` populations. Those that share a snapshot (ids in `kept`) stay together, as far as
    they have no result: no other population can continue from it."""
    left = {lane.id: lane for lane in lanes}
    groups = ([left.pop(name) for name in names if name in left] for names in kept)
    together = [group for group in groups if group]
    rest = list(left.values())
    size = max(1, -(-len(rest) // max(1, count - len(together))))
    return [*together, *(rest[start : start + size] for start in range(0, len(rest), size))]


def train(transport: Transport[AnyCall], errands: Sequence[Errand], seats: Sequence[Seat]) -> Generator[TrainingEvent]:
    """Train every errand, as many side by side as there are seats; messages as they come.

    A free seat takes the next errand that does not wait for another seat. When training is stopped, by Ctrl-C, by an
    error or because the caller closes this generator, the errands under way leave their state. Unless it was closed,
    results that come until then are yielded before the error.

    Raises:
        TaskError, WorkerError: see `Errand.hear`.
    """
    waiting, free = deque(errands), deque(seats)
    running: dict[AnyCall, tuple[Errand, Seat]] = {}
    joint = JointProgress(len(errands))
    try:
        while waiting or running:
            for errand in tuple(waiting):
                if (seat := errand.choose(free, seats)) is not None:
                    waiting.remove(errand)
                    free.remove(seat)
                    running[transport.call(errand.request(seat.device), seat)] = errand, seat
            for call in transport.wait(list(running)):
                errand, seat = running[call]
                message, ended = errand.hear(call)
                if message is not None:
                    yield joint.add(errand, message) if isinstance(message, TrainingProgress) else message
                if ended:
                    call.close()
                    del running[call]
                    free.appendleft(seat)
                    if errand.over:
                        yield from errand.failed()
                        joint.close(errand)
                    else:
                        joint.pause(errand)
                        waiting.appendleft(errand)  # its lanes without a result come before other errands
    except GeneratorExit:  # the caller wants no more
        for errand, frame in _stopped(transport, running):
            errand.keep(frame)
        raise
    except BaseException:
        for errand, frame in _stopped(transport, running):
            if isinstance(message := errand.told(frame), TrainingResult):
                yield message
        raise
    finally:
        for call in running:
            call.close()


def _stopped(
    transport: Transport[AnyCall], running: Mapping[AnyCall, tuple[Errand, Seat]]
) -> Iterator[tuple[Errand, Frame]]:
    """Last frames of trainings that may continue later: their state, and results of those that end meanwhile."""
    resumable = {call: errand.farewell for call, (errand, _) in running.items() if errand.resumable}
    for call, frame in farewell(transport, resumable):
        yield running[call][0], frame


@dataclass
class JointProgress:
    """Progress of errands, side by side or in turn, as if they were one."""

    errands: int
    running: dict[Errand, TrainingProgress] = field(default_factory=dict)
    began: dict[Errand, int] = field(default_factory=dict)
    """The epoch of each errand's first report; well above 0 where it continued from a snapshot."""
    done: int = 0
    fitness: dict[str, float | None] = field(default_factory=dict)
    latest: dict[str, Mapping[str, float | None]] = field(default_factory=dict)

    def add(self, errand: Errand, progress: TrainingProgress) -> TrainingProgress:
        """Progress of all errands, after that of one. The epoch is the mean over errands, rounded down; the rate is the
        sum over those under way."""
        self.running[errand] = progress
        self.began.setdefault(errand, progress.epoch)
        self.fitness |= progress.fitness
        self.latest |= progress.latest
        epochs = self.done * progress.epochs + sum(part.epoch for part in self.running.values())
        return TrainingProgress(
            epoch=epochs // self.errands,
            epochs=progress.epochs,
            env_steps_per_second=sum(part.env_steps_per_second for part in self.running.values()),
            fitness=dict(self.fitness),
            latest=dict(self.latest),
            resumed=sum(self.began.values()) // self.errands,
            nodes=self._nodes(),
        )

    def _nodes(self) -> dict[str, NodeShare]:
        found: dict[str, NodeShare] = {}
        for part in self.running.values():
            for name, share in part.nodes.items():
                before = found.get(name, NodeShare(lanes=0, env_steps_per_second=0.0))
                rate = before.env_steps_per_second + share.env_steps_per_second
                found[name] = NodeShare(lanes=before.lanes + share.lanes, env_steps_per_second=rate)
        return found

    def pause(self, errand: Errand) -> None:
        """No worker trains the errand for now: it stays at its epoch, with a rate of 0."""
        if errand in self.running:
            self.running[errand] = replace(self.running[errand], env_steps_per_second=0.0, nodes={})

    def close(self, errand: Errand) -> None:
        """The errand has its results."""
        self.running.pop(errand, None)
        self.done += 1
