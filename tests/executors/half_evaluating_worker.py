"""A training worker that scores the first policy it is given and then dies. It dies before that if it should also play
an untrained policy of a lane that it was not given."""

import os

from openeureka.worker import Channel

channel = Channel()
request = channel.receive()
assert request is not None
lane = next(iter(request.blobs))
assert request.header["untrained"].keys() <= request.blobs.keys()
channel.send({"score": {"lane": lane, "fitness": 1.0, "episode_length": 2.0, "episodes": 3}})
os._exit(1)
