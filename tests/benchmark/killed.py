"""Kills a bench with SIGKILL after its k-th commit and continues it, for k = 0, stride, 2 * stride and so on. Prints
what each bench asked, trained and found.

It is a script with few imports, because it forks for each run. It kills only at commits: what is not committed yet is
lost with any process. benchmarks/crashes.py kills between commits too.
"""

import json
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import scipy.special  # noqa: F401 -- a verdict imports it late, and each fork would pay for that

from openeureka.benchmark.bench import JSON, PAGE, bench
from openeureka.store import artifacts
from openeureka.store.db import Database

sys.path.insert(0, str(Path(__file__).parent))
from toys import PLAN, lines, play


def in_child(work: Callable[[], object]) -> bool:
    """Run in a fork. Returns whether the fork was killed."""
    child = os.fork()
    if child == 0:
        work()
        os._exit(0)
    status = os.waitpid(child, 0)[1]
    if not os.WIFSIGNALED(status) and os.WEXITSTATUS(status):
        sys.exit("A bench failed instead of being killed.")
    return os.WIFSIGNALED(status)


def killing(k: int) -> None:
    """Make this process kill itself after commit number k, counted from 0. Writes of the bench's files count too."""
    left = [k]

    def counted(write: Callable[..., None], counts: Callable[..., bool]) -> Callable[..., None]:
        def wrapped(*args: object) -> None:
            write(*args)
            left[0] -= counts(*args)
            if left[0] < 0:
                os.kill(os.getpid(), signal.SIGKILL)

        return wrapped

    Database.put = counted(Database.put, lambda *_: True)
    artifacts.write = counted(artifacts.write, lambda directory, name, _: name in (JSON, PAGE))


def go(folder: Path, k: int | None) -> None:
    os.environ["XDG_STATE_HOME"] = str(folder / "state")
    with pytest.MonkeyPatch.context() as patch:
        play(patch, folder)
        if k is not None:
            killing(k)
        bench(PLAN, dir=folder / "bench")


def left(folder: Path) -> dict[str, object]:
    found = json.loads((folder / "bench" / "bench.json").read_text())
    return {"asked": lines(folder, "asked"), "trained": lines(folder, "trained"), "found": found}


def main(root: Path, stride: int) -> None:
    whole = root / "whole"
    whole.mkdir()
    in_child(lambda: go(whole, None))
    report = {"whole": left(whole), "killed": []}
    for k in range(0, 10_000, stride):
        folder = root / str(k)
        folder.mkdir()
        if not in_child(lambda folder=folder, k=k: go(folder, k)):
            break
        in_child(lambda folder=folder: go(folder, None))
        report["killed"].append(left(folder))
    print(json.dumps(report))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
