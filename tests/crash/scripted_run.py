"""Kills a scripted run with SIGKILL at its k-th step, for every STRIDE-th k there is, and resumes it each time.

`python scripted_run.py DIR MODE STRIDE` leaves DIR/whole (never killed) and DIR/<k>. With MODE `around`, steps are just
before and just after each write; with MODE `within`, they are before each SQL statement and each rename, so also
between a reply's arrival and its commit.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from openeureka import search
from openeureka.config import RunConfig
from openeureka.loop import run
from openeureka.person import EmptyDesk
from openeureka.store import Store, artifacts, say
from openeureka.store.db import Database
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyTrainer, reply
from openeureka.types import Generation, Place, Prompt, Remark, RemarkKind, Reply

CONFIG = RunConfig(sample=3, iteration=3, repair=1, refill=1, seeds=2, feedback="human")
SCRIPT = [
    *(reply(1), "no code at all", reply(2)),  # generation 0; its second slot takes a repair turn and a refill
    *("```python\nstill wrong\n```", reply(3)),
    *(reply(2), reply(1.5), reply(1)),  # generation 1: nothing better
    *(reply(4), "nothing", reply(4)),  # generation 2: equal programs, and a slot that is given up
    *("nothing", "nothing", "nothing"),
]


@dataclass
class MeteredModel(ScriptedModel):
    """Goes on where the store's replies end. Its meter, a file with a line for each request, outlives the process."""

    store: Store = field(kw_only=True)

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        for _ in range(n):
            self.said = len(self.store.replies())
            with self.store.directory.with_suffix(".meter").open("a") as meter:
                meter.write(f"{self.said}\n")
            yield from super().sample(prompt, n=1, seed=seed)


@dataclass
class Person(EmptyDesk):
    """Says three things of each generation, and none of them twice: who was killed remembers what is kept."""

    store: Store

    def invite(self, generation: Generation) -> None:
        words = Remark(kind=RemarkKind.WORDS, text=f"of generation {generation.index}")
        chosen = Remark(kind=RemarkKind.FAVOURITE, candidate=Place(generation.index, 0))
        self.remarks = [words, chosen, Remark(kind=RemarkKind.GO)]

    def listen(self, seconds: float) -> None:
        say(self.store.directory, self.remarks[len(self.store.unheard())])


def whole_run(directory: Path) -> None:
    with Store.open(directory, CONFIG) as store:
        model = MeteredModel(SCRIPT, store=store)
        run(CONFIG, store, model, ToyChecker(), ToyTrainer(), TOY, search.make(CONFIG), None, Person(store))


class Countdown:
    """Ends the process, as a power cut would, when it is called for the k-th time."""

    def __init__(self, k: int) -> None:
        self.left = k

    def __call__(self, *_: object) -> None:
        self.left -= 1
        if self.left < 0:
            os.kill(os.getpid(), signal.SIGKILL)


def die_around_writes(countdown: Countdown) -> None:
    put, write = Database.put, artifacts.write

    def around(function: Callable[..., None], paid: Callable[..., bool]) -> Callable[..., None]:
        def wrapped(*args: Any) -> None:
            if not paid(*args):
                countdown()
            function(*args)
            countdown()

        return wrapped

    # A reply has been paid for when it arrives: the moment before it is committed belongs to `within`.
    Database.put = around(put, lambda database, table, *rows: table == "replies")
    artifacts.write = around(write, lambda *_: False)


def die_within_writes(countdown: Countdown) -> None:
    prepare, replace = Database._prepare, os.replace

    def traced(database: Database, writable: bool) -> None:
        database._connection.set_trace_callback(lambda sql: sql.startswith("SELECT") or countdown())
        prepare(database, writable)

    def counted(source: str, target: Path) -> None:
        countdown()
        replace(source, target)

    Database._prepare = traced
    os.replace = counted


def in_child(work: Callable[[], None]) -> int:
    """Run in a fork, so that Python starts once for all of them; the signal that ended it, or 0."""
    child = os.fork()
    if child == 0:
        work()
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, "a run failed instead of being killed"
    return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def main(folder: Path, mode: str, stride: int) -> None:
    die = {"around": die_around_writes, "within": die_within_writes}[mode]
    in_child(lambda: whole_run(folder / "whole"))
    for k in range(0, 10_000, stride):
        directory = folder / str(k)

        def killed(directory: Path = directory, k: int = k) -> None:
            die(Countdown(k))
            whole_run(directory)

        if in_child(killed) == 0:
            return  # it had fewer steps than k
        in_child(lambda directory=directory: whole_run(directory))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]))
