"""What a run loses when it is killed: SIGKILL at its k-th step, for every possible k, and each time a resumption.

    python benchmarks/crashes.py                    # every point; writes benchmarks/results/crashes.json
    python benchmarks/crashes.py --stride 5         # every fifth point of each mode; kept only with --out

The search is scripted, so that all of its steps are the same each time: three generations, repairs, refills, equal
programs, a slot that is given up, a person's remarks, final trainings, tryouts. Further scripted runs are searches that
cut lanes, screen rewards and carry a policy on, a training of given rewards as by `eureka train`, and the fitting of a
reward's numbers as by `eureka tune`. Steps are, by mode:

    around   just before and just after each write to the store or to a file
    within   before each SQL statement and each rename, so also between a reply's arrival and its commit
    between  at each event that a display is told of: phases, replies, verdicts, progress in training, results
"""

from __future__ import annotations

import os
import signal
import sqlite3
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import cmaes  # noqa: F401 -- imported late, and each fork would pay for that
import numpy  # noqa: F401 -- so is this
import scipy.special  # noqa: F401 -- and this, by a verdict
from records import command_line, machine, results, write

from openeureka import strategies
from openeureka.config import NO_MODEL, RunConfig
from openeureka.events import Event, Tell
from openeureka.loop import run
from openeureka.method import given
from openeureka.method.lanes import Lanes
from openeureka.refine import tuning
from openeureka.store import Store, artifacts, say
from openeureka.store.db import FILENAME, Database
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyDesk, ToyTrainer, reply
from openeureka.types import Candidate, Generation, Place, Prompt, Remark, RemarkKind, Reply

RESULTS = results("crashes")
CONFIG = RunConfig(sample=3, iteration=3, repair=1, refill=1, seeds=3, feedback="human")
"""With the errors that the trainer states, two rewards are level with the best one: they play again, and race."""
SCRIPT = [
    reply(1), "no code at all", reply(2),  # generation 0; its second slot takes a repair turn and a refill
    "```python\nstill wrong\n```", reply(3),
    reply(2), reply(1.5), reply(1),  # generation 1: two repeat earlier programs, one of them twice; nothing better
    reply(1), reply(2.5),
    reply(4), "nothing", reply(4),  # generation 2: equal programs, and a slot that is given up
    "nothing", "nothing", reply(4), "nothing",
]  # fmt: skip


@dataclass
class MeteredModel(ScriptedModel):
    """Goes on where the store's replies end. Its meter, a file with a line for each request, outlives the process."""

    store: Store = field(kw_only=True)

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        for _ in range(n):
            self.said = len(self.store.talk.replies())
            with self.store.directory.with_suffix(".meter").open("a") as meter:
                meter.write(f"{self.said}\n")
            yield from super().sample(prompt, n=1, seed=seed)


@dataclass
class Person:
    """Says three things of each generation, none of them twice: after a kill it goes by the remarks in the store."""

    store: Store

    def invite(self, generation: Generation) -> None:
        words = Remark(kind=RemarkKind.WORDS, text=f"of generation {generation.index}")
        chosen = Remark(kind=RemarkKind.FAVOURITE, place=Place(generation.index, 0))
        self.remarks = [words, chosen, Remark(kind=RemarkKind.GO)]

    def listen(self, seconds: float) -> None:
        say(self.store.directory, self.remarks[len(self.store.remarks.unheard())])


REPLIES = 17
"""Replies of the uninterrupted run: 3 + 1 + 1, 3 + 2, then 3 + 1 + 2 + 1."""


class Countdown:
    """Ends the process, as a power cut would, when it is called for the k-th time."""

    def __init__(self, k: int) -> None:
        self.left = k

    def __call__(self, *_: object) -> None:
        self.left -= 1
        if self.left < 0:
            os.kill(os.getpid(), signal.SIGKILL)


def around(countdown: Countdown) -> None:
    put, write = Database.put, artifacts.write

    def counted(function: Callable[..., None], paid: Callable[..., bool]) -> Callable[..., None]:
        def wrapped(*args: Any) -> None:
            if not paid(*args):
                countdown()
            function(*args)
            countdown()

        return wrapped

    # A reply has been paid for when it arrives: the moment before it is committed belongs to `within`.
    Database.put = counted(put, lambda database, table, *rows: table == "replies")
    artifacts.write = counted(write, lambda *_: False)


def within(countdown: Countdown) -> None:
    prepare, replace = Database._prepare, os.replace

    def traced(self: Database, writable: bool, migrate: bool) -> None:
        self._connection.set_trace_callback(lambda sql: sql.startswith("SELECT") or countdown())
        prepare(self, writable, migrate)

    def counted(*names: str, **folders: int) -> None:
        countdown()
        replace(*names, **folders)

    Database._prepare = traced
    os.replace = counted


LISTENERS: list[Tell] = []


def tell(event: Event) -> None:
    for listener in LISTENERS:
        listener(event)


def between(countdown: Countdown) -> None:
    LISTENERS.append(lambda event: countdown())


MODES: Mapping[str, Callable[[Countdown], None]] = {"around": around, "within": within, "between": between}


def whole_run(directory: Path, config: RunConfig = CONFIG) -> None:
    """Run the search to its end, from the point that the directory has reached."""
    with Store.open(directory, config) as store:
        model = MeteredModel(SCRIPT, store=store)
        trainer, strategy = ToyTrainer(error=0.5), strategies.make(config)
        run(config, store, model, ToyChecker(), trainer, TOY, strategy, tell, Person(store))


SCREEN = RunConfig(sample=1, iteration=2, screen=3, refill=0, seeds=1)
SCREENED = [reply(4), *(reply(-3), "nothing", reply(8))]


def whole_screen(directory: Path) -> None:
    """Two generations; in the second, one of two programs trains."""
    with Store.open(directory, SCREEN) as store:
        model, strategy = MeteredModel(SCREENED, store=store), strategies.make(SCREEN)
        run(SCREEN, store, model, ToyChecker(), ToyTrainer(), TOY, strategy, tell, ToyDesk())


GIVEN = replace(CONFIG, model=NO_MODEL, sample=0, iteration=0, feedback="none")


def whole_training(directory: Path) -> None:
    """Three given rewards with three seeds each, as far as the directory lacks them."""
    candidate = Candidate.of("def compute_reward():\n    return 3.0, {}\n")
    with Store.open(directory, GIVEN) as store:
        given.keep(store, {"human": None, "mine": (candidate, ToyChecker().check(candidate)), "sparse": None})
        given.train(Lanes(GIVEN, store, ToyTrainer(error=0.5), tell))


TUNED = replace(GIVEN, tune=10, sample=4, seeds=3)
"""Three rounds, the last of two weightings."""


def whole_tuning(directory: Path) -> None:
    """Tune the two numbers of a reward, as far as the directory lacks it: one decides F, the other changes nothing."""
    candidate = Candidate.of("def compute_reward(x):\n    y = 2.0 * x\n    return 3.0 * y\n")
    with Store.open(directory, TUNED) as store:
        tuning.keep(store, candidate, ToyChecker().check(candidate))
        tuning.tune(Lanes(TUNED, store, ToyTrainer(error=0.5), tell), ToyChecker())


WHOLE: Mapping[str, Callable[[Path], None]] = {
    "search": whole_run,
    "halving": partial(whole_run, config=replace(CONFIG, iteration=1, schedule="halving")),
    "screen": whole_screen,
    "polish": partial(whole_run, config=replace(CONFIG, iteration=1, polish=3)),
    "train": whole_training,
    "tune": whole_tuning,
}


def in_child(work: Callable[[], None]) -> int:
    """Run in a fork, so that Python starts once for all of them; returns the signal that ended it, or 0."""
    child = os.fork()
    if child == 0:
        work()
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    if not os.WIFSIGNALED(status) and os.WEXITSTATUS(status):
        sys.exit("A run failed instead of being killed.")
    return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def kill_and_resume(folder: Path, kind: str, mode: str, k: int) -> Path | None:
    """A run killed at its k-th step and finished by a second process; None when it has fewer steps."""
    directory = folder / f"{kind}-{mode}-{k}"

    def killed() -> None:
        MODES[mode](Countdown(k))
        WHOLE[kind](directory)

    if in_child(killed) == 0:
        return None
    in_child(lambda: WHOLE[kind](directory))
    return directory


# --- what is left ----------------------------------------------------------------------------------------------------


@dataclass(kw_only=True)
class Outcome:
    """Over all points of a mode: how many there were, and how many runs ended as if they had never been killed."""

    points: int = 0
    intact: int = 0
    """SQLite finds no fault in the file."""
    same_rows: int = 0
    same_files: int = 0
    """Byte for byte, the best reward and its policy among them."""
    replies_asked_again: int = 0
    """Over all points. A reply that is in flight when the process dies has to be asked for again."""

    def add(self, directory: Path, whole: Path) -> None:
        self.points += 1
        self.intact += intact(directory)
        self.same_rows += rows(directory) == rows(whole)
        self.same_files += files(directory) == files(whole)
        again = len(asked(directory)) - len(asked(whole))
        if again > 1:
            sys.exit(f"{directory.name} asked again for {again} replies, and only one can have been in flight.")
        self.replies_asked_again += again


def intact(directory: Path) -> bool:
    with sqlite3.connect(directory / FILENAME) as connection:
        return connection.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def rows(directory: Path) -> dict[str, list[tuple[Any, ...]]]:
    with sqlite3.connect(directory / FILENAME) as connection:
        tables = [name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
        return {table: sorted(connection.execute(f"SELECT * FROM {table}"), key=repr) for table in tables}


def files(directory: Path) -> dict[str, bytes]:
    found = (path for path in directory.rglob("*") if path.is_file() and path.parent != directory)
    return {str(path.relative_to(directory)): path.read_bytes() for path in found}


def asked(directory: Path) -> list[str]:
    meter = directory.with_suffix(".meter")
    return meter.read_text().split() if meter.exists() else []


def measure(folder: Path, kind: str, stride: int) -> dict[str, Outcome]:
    whole = folder / kind
    WHOLE[kind](whole)  # in this process: forks inherit what a first run caches
    if kind == "search":
        assert len(asked(whole)) == REPLIES
    found = {mode: Outcome() for mode in MODES}
    for mode, outcome in found.items():
        k = 0
        while (directory := kill_and_resume(folder, kind, mode, k)) is not None:
            outcome.add(directory, whole)
            k += stride
    return found


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument(
        "--stride", type=int, default=1, help="take every so many-th point; beyond 1 for a look, which --out keeps"
    )
    parser.add_argument("--out", type=Path, default=RESULTS)
    options = parser.parse_args()
    # No disk is needed: the page cache outlives a killed process, and in memory the syncs of hundreds of runs are free.
    place = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(dir=place) as folder:
        found = {kind: measure(Path(folder), kind, options.stride) for kind in WHOLE}
    report = {
        **machine("cpu"),
        "sqlite": sqlite3.sqlite_version,
        "stride": options.stride,
        "runs": {kind: {mode: asdict(outcome) for mode, outcome in modes.items()} for kind, modes in found.items()},
    }
    if options.stride == 1 or options.out != RESULTS:
        write(options.out, report)
    for kind, modes in found.items():
        for mode, outcome in modes.items():
            print(f"{kind}, {mode}: {outcome}")


if __name__ == "__main__":
    main()
