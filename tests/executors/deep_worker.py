"""The training worker, but its first physics step raises an error that names the package's functions on the stack."""

import sys

from openeureka.errors import TaskError
from openeureka.executors import child
from openeureka.sim import cpu


class Batch(cpu.Batch):
    def step(self, *_: object, **__: object) -> None:
        frame, names = sys._getframe(1), []
        while frame is not None:
            names.append(frame.f_code.co_name) if "/openeureka/" in frame.f_code.co_filename else None
            frame = frame.f_back
        raise TaskError(" ".join(reversed(names)))


cpu.Batch = Batch
child.main()
