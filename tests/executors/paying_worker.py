"""A training worker that is asked what programs pay, and dies at the program `deadly`."""

import os

from openeureka.worker import Channel

channel = Channel()
request = channel.receive()
assert request is not None
for program in request.header["programs"]:
    if program == "deadly":
        os._exit(1)
    channel.send({"program": program, "paid": []})
channel.send({"done": True})
