"""A training worker that takes its request and says nothing."""

import time

from openeureka.worker import Channel

Channel().receive()
time.sleep(60)
