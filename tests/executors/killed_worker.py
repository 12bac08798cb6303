"""A training worker that is killed at every request, as on a machine that has run out of memory."""

import os
import signal

from openeureka.worker import Channel

Channel().receive()
os.kill(os.getpid(), signal.SIGKILL)
