"""The process that trains: reads one request a frame, streams progress and results, dies with its parent."""

from __future__ import annotations

import dataclasses

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
            env, jobs, budget = unpack_jobs(header)
            for message in Population(env, jobs, budget, **options).train():
                frame = pack(message)
                channel.send(frame.header, frame.blobs)
        else:
            for score in evaluate(header["env"], request.blobs, seed=header["seed"], **options):
                channel.send({"score": dataclasses.asdict(score)})
        channel.send({"done": True})


if __name__ == "__main__":
    main()
