"""A training worker whose results name the device that it was given. At a lane named `patient...` it waits for a file,
at one named `deadly...` it dies."""

import dataclasses
import os
import time

from openeureka.types import TrainingProgress
from openeureka.worker import Channel

channel = Channel()
request = channel.receive()
assert request is not None
lanes = [lane["id"] for lane in request.header["lanes"]]  # without `wire`, whose imports take a second
progress = TrainingProgress(
    epoch=3, epochs=4, env_steps_per_second=100.0, fitness={lane: float(os.getpid()) for lane in lanes}
)
channel.send({"progress": dataclasses.asdict(progress)})
for lane in lanes:
    while lane.startswith("patient") and not os.path.exists(os.environ["SIGNAL"]):
        time.sleep(0.01)
    if lane.startswith("deadly"):
        os._exit(1)
    said = {"lane": lane, "state": "finished", "fitness": 1.0, "curves": {}, "env_steps": 1, "seconds": 0.0}
    channel.send({"result": {**said, "message": request.header["device"], "peaks": {}, "clock": []}})
channel.send({"done": True})
