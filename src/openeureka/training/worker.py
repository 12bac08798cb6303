"""The process that trains: reads one request a frame, streams progress and results, dies with its parent."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable

import torch

from ..worker import Channel
from .evaluate import evaluate
from .population import Population
from .wire import pack, unpack_jobs


def main() -> None:
    channel = Channel()
    while (request := channel.receive()) is not None:
        header = request.header
        options = {"device": header["device"], "threads": header["threads"]}
        if header["threads"]:
            torch.set_num_threads(header["threads"])
        if header["device"].startswith("cuda"):
            torch.cuda.set_device(header["device"])  # graphs are captured on the current device
        if header["do"] == "train":
            env, jobs, budget = unpack_jobs(request)
            for message in Population(env, jobs, budget, **options).train():
                frame = pack(message)
                channel.send(frame.header, frame.blobs)
        else:
            alive = _signs_of_life(channel)
            for score in evaluate(header["env"], request.blobs, seed=header["seed"], after_step=alive, **options):
                channel.send({"score": dataclasses.asdict(score)})
        channel.send({"done": True})


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
