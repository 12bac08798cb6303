"""Stands in for `openeureka.llm.local_server`: its replies tell how it was started and what it was asked for."""

import json
import os
import sys

from openeureka.worker import Channel

channel = Channel()
path, *capacity = sys.argv[1:]
kind = os.path.basename(path)
if kind in ("missing", "load"):
    channel.send({"error": kind, "detail": "the reason"})
elif kind != "dies":
    channel.send({"ready": True})
    while (frame := channel.receive()) is not None:
        if kind == "hangs up":
            print("out of memory", file=sys.stderr)
            sys.exit(1)
        told = {"capacity": capacity, "spin": os.environ["GOMP_SPINCOUNT"], **frame.header}
        texts = [json.dumps(told)] * frame.header["n"]
        channel.send({"texts": texts, "prompt_tokens": 50, "completion_tokens": [7] * len(texts), "seconds": 1.0})
