"""What is asked of workers for one population, and what is asked again when one of them dies or hangs."""

from __future__ import annotations

import dataclasses
import logging
import time
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..codec import to_builtins
from ..errors import StoreError, WorkerError
from ..training.wire import SNAPSHOT, pack_lanes, pack_question, unpack, unpack_score
from ..types import (
    Dynamics,
    Episodes,
    Evaluation,
    LaneSpec,
    RewardGraph,
    TrainBudget,
    TrainingEvent,
    TrainingProgress,
    TrainingResult,
    TrainingState,
)
from ..worker import Frame
from .snapshots import Snapshot, forget, groups
from .transport import FAREWELL, LONGEST_FAREWELL, Call, Seat, Transport, WorkerLost

SNAPSHOT_SECONDS = 300.0
"""[s] between two snapshots of a training; one takes a fraction of a second."""
TOGETHER = 2
"""Attempts that train all unfinished lanes of a population together; after these, a single lane may be at fault."""
FATAL = 2
"""A state is removed after so many workers in a row were given it and died before they reported. A single death may
have another cause: a GPU that another program holds, a full disk and too little memory end a worker as early."""
LOSSES = 10
"""Machines that may be lost with one population or question before it counts as the cause."""

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Batch:
    """Lanes that one request asks to train."""

    lanes: tuple[LaneSpec, ...]
    budget: TrainBudget
    control: bool = False
    """Whether it only shows that this machine can train at all; its results are dropped."""


@dataclass(slots=True)
class _Heard:
    """What a worker has said of its attempt so far."""

    epoch: int = 0
    """The last that it reported."""
    kept: int = 0
    """Epoch of the last state that was kept."""
    reported: float = 0.0
    """[s] Time of its last report; 0 before the first."""
    apart: float = 0.0
    """[s] between its last two reports."""


class Errand:
    """Lanes that train as one population, until each has a result.

    They train together, together once more, then one by one, so that a lane that kills its process takes no other with
    it. Each attempt continues from the last snapshot. Three kinds of failed attempts do not count:

    - The machine was lost.
    - The attempt left a state from beyond the epoch where any before it died: in days of training, a worker may be
      killed more than once through no fault of its lanes.
    - The death shows that the state which the worker was given is at fault.

    The device may be at fault as well, so `choose` lets another one try.

    Args:
        snapshots: folder of its state while it is under way; None for one that begins anew when its worker dies.
    """

    def __init__(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget, snapshots: Path | None) -> None:
        self.lanes = tuple(lanes)
        self._env, self._budget, self._snapshots = env, budget, snapshots
        self._left = {lane.id: lane for lane in lanes}
        self._reasons: dict[str, str] = {}
        self._plan = self._attempts()
        self._attempt = next(self._plan, None)
        self._snapshot = Snapshot(None, {})
        self._heard = _Heard()
        self._losses = 0
        """Machines that were lost."""
        self._early = 0
        """Workers in a row that died before they reported, with the same state."""
        self._died: int | None = None
        """The furthest epoch at which a worker died."""
        self._device, self._devices = "", set[str]()
        """That of the attempt, and all of them."""
        self._deaths = Counter[str]()
        """By device; a death before the first report, as on a faulty GPU, counts twice."""

    def _attempts(self) -> Iterator[Batch]:
        """What to try next, from the lanes that have no result at that moment."""
        for _ in range(TOGETHER):
            if self._left:
                yield Batch(tuple(self._left.values()), self._budget)
        for lane in tuple(self._left.values()):
            yield Batch((lane,), self._budget)
        generated = not any(isinstance(lane.program, str) for lane in self.lanes)
        if generated and len(self._left) == len(self.lanes):
            human = LaneSpec(id="control", program="human", seed=self.lanes[0].seed)
            yield Batch((human,), dataclasses.replace(self._budget, env_steps=1), control=True)

    @property
    def over(self) -> bool:
        """Whether there is nothing more to try."""
        return self._attempt is None

    @property
    def resumable(self) -> bool:
        """Whether what is under way may leave a snapshot."""
        return self._snapshots is not None and self._attempt is not None and not self._attempt.control

    @property
    def farewell(self) -> float:
        """[s] that the worker may take for a last snapshot: its epoch must end first, and may be a slow one."""
        return min(max(FAREWELL, 2 * self._heard.apart), LONGEST_FAREWELL)

    def choose(self, free: Collection[Seat], seats: Sequence[Seat]) -> Seat | None:
        """The free seat to use now, where the fewest of its workers have died; None to wait for a busy one.

        It waits if workers have died less often elsewhere, and either two died here, or one before it reported, or the
        attempt is the control, which judges the machine. A single later death is rare, and a GPU should not idle for
        hours because of it.
        """
        assert self._attempt is not None
        self._devices = {seat.device for seat in seats}
        found = min(free, key=lambda seat: (self._deaths[seat.device], seat.device == self._device), default=None)
        if found is None:
            return None
        deaths = self._deaths[found.device]
        waits = self._attempt.control or deaths > 1
        return None if waits and any(self._deaths[device] < deaths for device in self._devices) else found

    def request(self, device: str) -> Frame:
        """The request of the current attempt to a worker on this device."""
        assert self._attempt is not None
        self._device, self._heard = device, _Heard()
        packed = pack_lanes(self._env, self._attempt.lanes, self._attempt.budget)
        folder = self._snapshots if self.resumable else None
        self._snapshot = Snapshot(folder, _about(packed, device), others=len(self._attempt.lanes) < len(self._left))
        state = self._snapshot.read()
        header = {"do": "train", "snapshot_seconds": SNAPSHOT_SECONDS if folder is not None else 0.0, **packed.header}
        return Frame(header, {**packed.blobs, **({SNAPSHOT: state} if state is not None else {})})

    def hear(self, call: Call) -> tuple[TrainingEvent | None, bool]:
        """The worker's next event, None if it is of no use to the caller, and whether the attempt is over.

        Raises:
            TaskError: when the task's own code fails.
            WorkerError: when no lane could be trained, and then not even the task's human reward on any device: the
                machine is at fault, not a generated reward.
        """
        assert self._attempt is not None
        try:
            frame = call.receive()
        except WorkerError as error:
            if not self._excused(error):
                self._end(self._attempt, str(error))
            return None, True
        if frame.header.get("done"):
            self._snapshot.remove()
            self._end(self._attempt, "Training stopped: The worker process ended without a result.")
            return None, True
        return self.told(frame), False

    def _excused(self, error: WorkerError) -> bool:
        """Whether an attempt that ended with this error does not count, and is made once more: see the class.

        Raises:
            WorkerError: when the control has died on every device.
        """
        assert self._attempt is not None
        if isinstance(error, WorkerLost):
            self._losses += 1
            if self._losses <= LOSSES:
                return True
        self._deaths[self._device] += 1 if self._heard.reported else 2
        if self._attempt.control:
            if all(self._deaths[device] > 1 for device in self._devices):
                raise WorkerError(self._reasons[self.lanes[0].id]) from None
            return True
        self._early += self._snapshot.suspect
        if self._early == FATAL:
            self._early = 0
            self._snapshot.distrust()
            return True
        further = self._died is not None and self._heard.kept > self._died
        self._died = max(self._heard.epoch, self._died or 0)
        return further

    def keep(self, frame: Frame) -> None:
        """Keep the state in a frame, if any. Where the disk is full, the state before it stays and training goes on:
        there may be room again by the time that it has results."""
        if SNAPSHOT not in frame.blobs:
            return
        try:
            self._snapshot.write(frame.blobs[SNAPSHOT])
        except StoreError as error:
            _log.warning("A training goes on, but its state could not be saved. %s", error)
        else:
            self._heard.kept, self._early = self._heard.epoch, 0

    def told(self, frame: Frame) -> TrainingEvent | None:
        """The event in a frame, None if it is of no use to the caller, who has stored all earlier ones by now."""
        assert self._attempt is not None
        self.keep(frame)
        if frame.header.get("done") and not self._left:
            self._snapshot.remove()
        if not frame.header or frame.header.get("done") or self._attempt.control:
            return None
        message = unpack(frame)
        if isinstance(message, TrainingProgress):
            now, heard = time.monotonic(), self._heard
            self._snapshot.trust()
            heard.epoch, self._early = message.epoch, 0
            heard.apart, heard.reported = now - (heard.reported or now), now
        elif self._left.pop(message.lane, None) is None:
            return None  # a machine that was lost had told it already
        return message

    def _end(self, attempt: Batch, reason: str) -> None:
        """Go on to the next attempt. A lane that no attempt can train keeps the reason of its last one."""
        self._reasons |= {lane.id: reason for lane in attempt.lanes}
        self._attempt = next(self._plan, None)
        if self._attempt is not None and self._attempt.control:
            self._deaths = Counter({self._device: 1})  # elsewhere first; deaths that lanes may have caused do not count
        if self._attempt is None:
            forget(self._snapshots, self._env, [lane.id for lane in self.lanes])

    def failed(self) -> Iterator[TrainingResult]:
        """Results of the lanes that no attempt could train."""
        for lane in self._left.values():
            yield TrainingResult(
                lane=lane.id, state=TrainingState.FAILED, fitness=None, curves={}, env_steps=0, seconds=0.0,
                message=self._reasons[lane.id],
            )  # fmt: skip


def together(snapshots: Path | None, env: str, budget: TrainBudget, device: str) -> list[list[str]]:
    """Lane ids of each population that has left a snapshot from which such a training can continue."""
    return groups(snapshots, _about(pack_lanes(env, (), budget), device))


def _about(asked: Frame, device: str) -> dict[str, Any]:
    """What a snapshot of this request is identified by."""
    return {**asked.header, "device": device.partition(":")[0]}


class Questions:
    """The methods of a `types.Trainer` that a single worker answers; a subclass adds `train`.

    Args:
        seat: of the worker; `rewards` runs on its CPU cores.
    """

    def __init__(self, transport: Transport[Any], seat: Seat) -> None:
        self._transport, self._seat = transport, seat

    def evaluate(
        self,
        env: str,
        policies: Mapping[str, bytes],
        *,
        seed: int,
        episodes: int = 0,
        dynamics: Mapping[str, Dynamics] | None = None,
        record: Collection[str] = (),
        untrained: Mapping[str, int] | None = None,
    ) -> Iterator[Evaluation]:
        """Score of each policy. A worker that dies is replaced once, by one that scores the remaining policies; one
        whose machine is lost is replaced up to `LOSSES` times.

        Raises:
            TaskError: when the task's own code fails.
            WorkerError: when the second worker dies too, or one machine too many is lost.
        """
        header = {"do": "evaluate", "env": env, "seed": seed, "episodes": episodes}
        header |= {"dynamics": to_builtins(dynamics or {}), "record": list(record)}
        left, deaths, losses = dict(policies), 0, 0
        while left and deaths < 2:
            header["untrained"] = {lane: own for lane, own in (untrained or {}).items() if lane in left}
            with closing(self._transport.call(Frame(header, left), self._seat)) as call:
                try:
                    while not (frame := call.receive()).header.get("done"):
                        if "score" in frame.header:
                            score = unpack_score(frame)
                            del left[score.lane]
                            yield score
                except WorkerLost:
                    losses += 1
                    if losses > LOSSES:
                        raise
                except WorkerError:
                    deaths += 1
                    if deaths > 1 and left:
                        raise
                else:
                    deaths += 1  # it was done, and left some out

    def rewards(
        self, env: str, programs: Mapping[str, RewardGraph], episodes: Sequence[Episodes]
    ) -> dict[str, Sequence[float]]:
        """What each program pays in each recorded state. If the worker dies, a second one begins behind the program
        that may have killed it. Programs that neither came to are left out.

        Raises:
            TaskError: when the task's own code fails.
        """
        paid: dict[str, Sequence[float]] = {}
        names, cores = list(programs), self._seat._replace(device="cpu")
        for _ in range(2):
            if not (left := {name: programs[name] for name in names if name not in paid}):
                break
            question, behind = pack_question(env, left, episodes), 1
            with closing(self._transport.call(question, cores)) as call, suppress(WorkerError):
                while not (frame := call.receive()).header.get("done"):
                    if "program" in frame.header:
                        name = frame.header["program"]
                        paid[name] = frame.header["paid"]
                        behind = names.index(name) + 2
                break
            names = names[behind:] + names[:behind]
        return paid
