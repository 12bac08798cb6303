"""Videos of every trained policy, made while the search goes on.

A thread hands one policy after the other to a child process of the lowest priority, so that no training waits for a
picture. A search that ends waits for its last videos. A search that is stopped leaves them to `eureka resume` or
`eureka report`: a video is missing exactly when its file is.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from queue import Queue
from threading import Thread

from ..config import RunConfig
from ..errors import EurekaError
from ..events import Event
from ..film import video
from ..score import counted_peak
from ..store import Store, artifacts, is_run
from ..types import Generation, Peak
from .view import VIDEO

SECONDS = 6.0
"""Length of a candidate's video in simulated time: enough to see what it does."""
TIMEOUT = 3600.0
"""[s] for one video: in the background it may get a hundredth of a core."""


def missing(directory: Path) -> dict[str, bytes]:
    """The policies to film, by lane id: of each lane that is trained and not filmed, the policy that counts."""
    with Store.view(directory) as store:
        # Of the final trainings, and of those that carry a policy on, only the best is filmed: `best/`, `polished/`.
        lanes = [lane.id for lane in store.lanes.all().values() if lane.role not in ("final", "polish", "robust")]
        results = store.lanes.results()
        lanes = [lane for lane in lanes if lane in results and not artifacts.exists(directory, _place(lane))]
        return policies(store, lanes)


def policies(store: Store, lanes: Iterable[str]) -> dict[str, bytes]:
    """The policy that counts for each lane, by lane id; lanes without a policy are left out."""
    found = {lane: store.lanes.policy(lane, peak) for lane, peak in _counted(store, lanes).items()}
    return {lane: policy for lane, policy in found.items() if policy is not None}


def kept(directory: Path, lanes: Iterable[str]) -> frozenset[str]:
    """The lanes for which the file of the policy that counts exists."""
    with Store.view(directory) as store:
        return frozenset(lane for lane, peak in _counted(store, lanes).items() if store.lanes.has_policy(lane, peak))


def _counted(store: Store, lanes: Iterable[str]) -> dict[str, Peak]:
    plays, limits = store.lanes.plays(), store.config.cost_limits
    return {lane: counted_peak(plays.get(lane), "fitness", limits) for lane in lanes}


def human(directory: Path) -> bytes | None:
    """The policy of the human reward, where the run has trained it as a baseline."""
    with Store.view(directory) as store:
        lanes = [lane.id for lane in store.lanes.all().values() if lane.role == "baseline" and lane.reward == "human"]
        return next(iter(policies(store, lanes).values()), None)


def film(directory: Path, env: str, trained: Iterable[tuple[str, bytes]], *, background: bool = False) -> str:
    """Write the video of each lane. Returns why a video is missing, as a sentence, or an empty string.

    A policy that cannot be shown is skipped. Where the machine cannot render at all, only the first one is tried.
    """
    problem = ""
    for lane, policy in trained:
        try:
            picture = video.render(env, policy, seconds=SECONDS, timeout=TIMEOUT, background=background)
        except video.NoRenderer as error:
            return str(error)
        except video.VideoUnavailable as error:
            problem = f"No video of {lane}: {error}"
            continue
        artifacts.write(directory, _place(lane), picture)
    return problem


def _place(lane: str) -> str:
    return f"lanes/{lane}/{VIDEO}"


class Filming:
    """Films the new policies of a search after each generation; a context that ends with the search."""

    def __init__(self, directory: Path, config: RunConfig) -> None:
        self._directory, self._config = directory, config
        self._policies: Queue[tuple[str, bytes] | None] = Queue()
        self._queued: set[str] = set()
        self._stopped = False
        self._thread = Thread(target=self._work, name="filming", daemon=True)

    def _work(self) -> None:
        try:
            film(self._directory, self._config.env, self._next(), background=True)
        except EurekaError:
            pass  # a full disk: the report that follows meets it again, and says so

    def _next(self) -> Iterator[tuple[str, bytes]]:
        while not self._stopped and (policy := self._policies.get()) is not None:
            yield policy
            self._policies.task_done()

    def wait(self) -> None:
        """Return when all that is trained so far is filmed, as far as this machine can."""
        while self._thread.is_alive() and self._policies.unfinished_tasks:
            time.sleep(0.1)

    @property
    def waiting(self) -> int:
        """Number of policies whose filming has not begun."""
        return self._policies.qsize()

    def __call__(self, event: Event) -> None:
        if isinstance(event, Generation):
            self._queue()  # which policy of a lane counts is known when all have played

    def _queue(self) -> None:
        left = missing(self._directory) if is_run(self._directory) else {}
        for lane in left.keys() - self._queued:
            self._queued.add(lane)
            self._policies.put((lane, left[lane]))

    def __enter__(self) -> Filming:
        self._thread.start()
        self._queue()
        return self

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Wait for what is left, unless the search was stopped: then the thread and its child end with this process."""
        self._stopped = error is not None
        self._policies.put(None)
        if not self._stopped:
            self._thread.join()
