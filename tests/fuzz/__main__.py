"""Tries many odd and damaged texts in child processes, counts crashes, and prints the seed of each.

cd tests
python -m fuzz 100000 --seed 7                       # longer than the tests
python -m fuzz 100000 --only program --seed 7        # graph, reply, program or call
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from random import Random

import torch

from .attempts import call, good_graphs, graph, program, reply

_BATCH, _BATCH_SECONDS, _MEMORY = 200, 120, 6 << 30


def counted(attempt: Callable[[Random], str], seeds: Sequence[str]) -> Counter[str]:
    """Outcomes of attempts in one child process. If it dies, each attempt is made again in a process of its own."""
    outcomes = _in_a_child(attempt, seeds)
    if outcomes is not None:
        return outcomes
    if len(seeds) > 1:
        return sum((counted(attempt, [seed]) for seed in seeds), Counter[str]())
    print(f"CRASH {attempt.__name__} {seeds[0]}", flush=True)
    return Counter(["crash"])


def _in_a_child(attempt: Callable[[Random], str], seeds: Sequence[str]) -> Counter[str] | None:
    end, other = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
            signal.alarm(_BATCH_SECONDS)
            outcomes = Counter(attempt(Random(seed)) for seed in seeds)
            os.write(other, json.dumps(outcomes).encode())
        except BaseException as error:  # the parent then tries the seeds one by one and names those that fail
            print(f"{type(error).__name__}: {str(error)[:300]}", flush=True)
        finally:
            os._exit(0)
    os.close(other)
    with os.fdopen(end, "rb") as answer:
        text = answer.read()
    os.waitpid(pid, 0)
    return Counter(json.loads(text)) if text else None


def _seeds(options: argparse.Namespace) -> Iterator[list[str]]:
    for first in range(0, options.count, _BATCH):
        yield [f"{options.seed}/{number}" for number in range(first, min(first + _BATCH, options.count))]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    attempts = {attempt.__name__: attempt for attempt in (graph, reply, program, call)}
    parser.add_argument("count", type=int, help="how many of each")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=attempts, help="one kind")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="for each kind")
    options = parser.parse_args()
    torch.set_num_threads(1)  # a forked child has none of torch's other threads
    good_graphs()
    for attempt in [attempts[options.only]] if options.only else attempts.values():
        outcomes, until = Counter[str](), time.monotonic() + options.seconds
        for seeds in _seeds(options):
            outcomes += counted(attempt, seeds)
            if time.monotonic() > until:
                break
        print(attempt.__name__, dict(outcomes), flush=True)


if __name__ == "__main__":
    main()
