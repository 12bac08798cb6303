"""Deals lanes into populations, and populations to workers: who waits, whose turn it is, how far all of them are."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from ..types import LaneSpec, NodeShare, TrainingEvent, TrainingProgress, TrainingResult
from ..worker import Frame
from .retry import Errand
from .transport import AnyCall, Seat, Transport, farewell


def deal(lanes: Sequence[LaneSpec], kept: Sequence[Sequence[str]], count: int) -> list[Sequence[LaneSpec]]:
    """Lanes of about `count` populations. What a snapshot was taken of (`kept`, ids) stays together, as far as it has
    no result: no other population can go on from it."""
    left = {lane.id: lane for lane in lanes}
    groups = ([left.pop(name) for name in names if name in left] for names in kept)
    together = [group for group in groups if group]
    rest = list(left.values())
    size = max(1, -(-len(rest) // max(1, count - len(together))))
    return [*together, *(rest[start : start + size] for start in range(0, len(rest), size))]


def train(transport: Transport[AnyCall], errands: Sequence[Errand], seats: Sequence[Seat]) -> Generator[TrainingEvent]:
    """Train every errand, as many side by side as there are seats; messages as they come.

    A seat that is free takes the next errand in turn that does not wait for another one. Where training is stopped, by
    Ctrl-C, by an error or as nobody wants more, what is under way leaves its state. Where somebody still listens,
    results that come until then are told before the error.

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
                        waiting.appendleft(errand)  # its lanes without a result go before anybody else's
    except GeneratorExit:  # nobody listens
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
    """What trainings that may go on later still say: their state, and results of those that end meanwhile."""
    resumable = {call: errand.farewell for call, (errand, _) in running.items() if errand.resumable}
    for call, frame in farewell(transport, resumable):
        yield running[call][0], frame


@dataclass
class JointProgress:
    """Progress of errands, side by side or in turn, as if they were one."""

    errands: int
    running: dict[Errand, TrainingProgress] = field(default_factory=dict)
    began: dict[Errand, int] = field(default_factory=dict)
    """The epoch at which each was first heard of; far from 0 where it goes on from a snapshot."""
    done: int = 0
    fitness: dict[str, float | None] = field(default_factory=dict)
    latest: dict[str, Mapping[str, float | None]] = field(default_factory=dict)

    def add(self, errand: Errand, progress: TrainingProgress) -> TrainingProgress:
        """The epoch is the mean over the errands, rounded down: that of one training. The rate is that of all that are
        under way."""
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
        """Nobody trains it for now: it is as far as it was, at no rate."""
        if errand in self.running:
            self.running[errand] = replace(self.running[errand], env_steps_per_second=0.0, nodes={})

    def close(self, errand: Errand) -> None:
        """The errand has its results."""
        self.running.pop(errand, None)
        self.done += 1
