"""A training worker whose evaluation gives signs of life."""

import time

from openeureka.worker import Channel

channel = Channel()
channel.receive()
for _ in range(8):
    time.sleep(0.1)
    channel.send({})
channel.send({"score": {"lane": "a", "fitness": 1.0, "episode_length": 2.0, "episodes": 3}})
channel.send({"done": True})
