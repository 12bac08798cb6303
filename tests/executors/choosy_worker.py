"""A training worker that dies with SIGFPE of a generated reward, as of an integer division by zero, but trains the
human one."""

import os
import signal

from openeureka.worker import Channel

channel = Channel()
request = channel.receive()
assert request is not None
for lane in request.header["lanes"]:  # without `wire`, whose imports take a second
    if lane["program"] != "human":
        os.kill(os.getpid(), signal.SIGFPE)
    said = {"lane": lane["id"], "state": "finished", "fitness": 1.0, "curves": {}, "env_steps": 1, "seconds": 0.0}
    channel.send({"result": {**said, "peaks": {}, "clock": []}})
channel.send({"done": True})
