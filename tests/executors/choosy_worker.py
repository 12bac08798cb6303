"""A training worker that a generated reward ends, and the human one does not: as with a graph that divides by zero."""

import os
import signal

from openeureka.training.wire import pack, unpack_lanes
from openeureka.types import TrainingResult, TrainingState
from openeureka.worker import Channel

channel = Channel()
request = channel.receive()
assert request is not None
for lane in unpack_lanes(request)[1]:
    if lane.program != "human":
        os.kill(os.getpid(), signal.SIGFPE)
    result = TrainingResult(
        lane=lane.id, state=TrainingState.FINISHED, fitness=1.0, curves={}, env_steps=1, seconds=0.0
    )
    frame = pack(result)
    channel.send(frame.header, frame.blobs)
channel.send({"done": True})
