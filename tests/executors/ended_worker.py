"""A training worker that the kernel ends: every job is named after a signal, and the worker sends it to itself."""

import os
import signal

from openeureka.worker import Channel

channel = Channel()
request = channel.receive()
assert request is not None
os.kill(os.getpid(), signal.Signals[request.header["jobs"][0]["id"]])
