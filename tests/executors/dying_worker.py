"""A training worker that finishes its first lane and then dies, as often as it is asked."""

import os

from openeureka.worker import Channel

channel = Channel()
request = channel.receive()
assert request is not None
lane = request.header["lanes"][0]["id"]  # without `wire`, whose imports take a second
if lane != "deadly":
    said = {"lane": lane, "state": "finished", "fitness": 1.0, "curves": {}, "env_steps": 1, "seconds": 0.0}
    channel.send({"result": {**said, "peaks": {}, "clock": []}})
os._exit(1)
