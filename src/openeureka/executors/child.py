"""The process that trains: reads one request per frame, streams progress and results, dies with its parent."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

import torch

from ..codec import convert
from ..errors import CapacityError, TaskError, WorkerError
from ..tasks.faults import fault
from ..training.episodes import rewards
from ..training.evaluate import evaluate
from ..training.population import Population
from ..training.wire import SNAPSHOT, pack, pack_score, unpack_lanes, unpack_question
from ..types import Dynamics, TrainingProgress
from ..worker import Channel, Frame


def main() -> None:
    channel = Channel()
    while (request := channel.receive()) is not None:
        header = request.header
        alive = _signs_of_life(channel)
        options: dict[str, Any] = {"device": header["device"], "threads": header["threads"], "alive": alive}
        if header["threads"]:
            torch.set_num_threads(header["threads"])
        if header["device"].startswith("cuda"):
            torch.cuda.set_device(header["device"])  # graphs are captured on the current device
        try:
            if header["do"] == "train":
                _train(channel, request, Population(*unpack_lanes(request), **options))
            elif header["do"] == "rewards":
                for name, paid in rewards(*unpack_question(request)):
                    channel.send({"program": name, "paid": paid})
            else:
                _evaluate(channel, request, options)
        except CapacityError:
            raise  # perhaps one lane's fault: without it the others may have room
        except WorkerError as error:
            sys.exit(str(error))  # the process that steps the worlds died: retried as if this one had
        except (Exception, SystemExit) as error:
            broken = error if isinstance(error, TaskError) else fault(error)
            if broken is None:
                raise
            channel.send({"broken": str(broken)})
        channel.send({"done": True})


def _evaluate(channel: Channel, request: Frame, options: Mapping[str, Any]) -> None:
    header = request.header
    scores = evaluate(
        header["env"],
        request.blobs,
        seed=header["seed"],
        episodes=header["episodes"],
        dynamics=convert(dict[str, Dynamics], header["dynamics"]),
        record=header["record"],
        untrained=header["untrained"],
        **options,
    )
    for score in scores:
        frame = pack_score(score)
        channel.send(frame.header, frame.blobs)


def _train(channel: Channel, request: Frame, population: Population) -> None:
    """Stream messages and, now and then, a snapshot to continue from; when the parent asks to stop, a last one."""
    if SNAPSHOT in request.blobs:
        population.resume(request.blobs[SNAPSHOT])
    saved = time.monotonic()
    for message in population.train():
        frame = pack(message)
        channel.send(frame.header, frame.blobs)
        if not isinstance(message, TrainingProgress):
            continue
        every, stopping = request.header["snapshot_seconds"], channel.ready()
        if stopping or (every and time.monotonic() - saved > every):
            channel.send({}, {SNAPSHOT: population.snapshot()})
            saved = time.monotonic()
        if stopping:
            channel.receive()
            return


def _signs_of_life(channel: Channel) -> Callable[[], None]:
    """Sends an empty frame at most once a second, so that the parent does not take this process for hung."""
    last = time.monotonic()

    def alive() -> None:
        nonlocal last
        if time.monotonic() - last > 1.0:
            last = time.monotonic()
            channel.send({})

    return alive


if __name__ == "__main__":
    main()
