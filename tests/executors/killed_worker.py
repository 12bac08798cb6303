"""A training worker that the kernel ends whatever it is asked, as a machine without memory does."""

import os
import signal

from openeureka.worker import Channel

Channel().receive()
os.kill(os.getpid(), signal.SIGKILL)
