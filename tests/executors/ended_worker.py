"""A training worker that the kernel ends: every lane is named after a signal, and the worker sends it to itself."""

import os
import signal

from openeureka.worker import Channel

channel = Channel()
request = channel.receive()
assert request is not None
os.kill(os.getpid(), signal.Signals[request.header["lanes"][0]["id"]])
