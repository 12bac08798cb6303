"""A training worker that the kernel ends: every lane is named after a signal, and the worker sends it to itself. A lane
named after the limit of address space makes it fail as where that is reached."""

import os
import signal

from openeureka.worker import Channel

channel = Channel()
request = channel.receive()
assert request is not None
name = request.header["lanes"][0]["id"]
if name == "RLIMIT_AS":
    raise MemoryError
os.kill(os.getpid(), signal.Signals[name])
