"""Training workers that outlive their call: each new one would load torch, which takes a process two seconds."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from openeureka.worker import Frame, Worker


class Pool:
    """Stands in for `Worker` where executors start one. A worker that is done with a call waits for the next."""

    def __init__(self) -> None:
        self._idle: dict[tuple[str, str | None], list[Worker]] = {}

    def __call__(self, module: str, **options: Any) -> Lent:
        idle = self._idle.setdefault((module, os.environ.get("PYTHONPATH")), [])
        return Lent(idle.pop() if idle else Worker(module, **options), idle)

    def close(self) -> None:
        for worker in (one for idle in self._idle.values() for one in idle):
            worker.close()


class Lent:
    """A worker for the time of one call. It lasts if the call was answered to its end and was never asked to stop."""

    def __init__(self, worker: Worker, idle: list[Worker]) -> None:
        self._worker, self._idle = worker, idle
        self._stopped = self._done = self._closed = False

    def __getattr__(self, name: str) -> Any:
        return getattr(self._worker, name)

    def send(self, header: Mapping[str, Any], blobs: Mapping[str, bytes] | None = None) -> None:
        self._stopped |= header.get("do") == "stop"
        self._worker.send(header, blobs)

    def receive(self, timeout: float | None = None) -> Frame:
        frame = self._worker.receive(timeout)
        self._done = bool(frame.header.get("done"))
        return frame

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        if self._done and not self._stopped:
            self._idle.append(self._worker)
        else:
            self._worker.close()
