"""A worker for tests: echoes frames, or misbehaves when told to."""

import multiprocessing
import os
import subprocess
import sys
import time

from openeureka.worker import Channel

channel = Channel()
while (frame := channel.receive()) is not None:
    match frame.header.get("do"):
        case "echo":
            print("a stray print must not break the stream")
            channel.send(frame.header, frame.blobs)
        case "die":
            sys.stderr.write("last words\n")
            sys.stderr.flush()
            os._exit(0)
        case "hang":
            time.sleep(60)
        case "garbage":
            os.write(channel._out, b"\xff" * 64)
        case "environment":
            channel.send({"environment": dict(os.environ)})
        case "terminate":
            forked = multiprocessing.get_context("fork").Process(target=time.sleep, args=(60,))
            forked.start()
            started = subprocess.Popen(["sleep", "60"])
            forked.terminate()
            started.terminate()
            forked.join()
            channel.send({"codes": [forked.exitcode, started.wait()]})
        case "leave":
            channel.send({"left": subprocess.Popen(["sleep", "900"]).pid})
            os.kill(os.getpid(), 9)
        case "print":
            print(frame.header["text"], end="", flush=True)
            channel.send({})
