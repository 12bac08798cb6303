"""Damaged and forged graphs and replies are refused or harmless: not one of ten thousand ends in another error.

A longer run with other seeds: `cd tests; python -m fuzz 100000 --seed 7`.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from random import Random

import pytest
import torch

from . import attempts

TESTS = Path(__file__).parents[1]
GRAPHS, REPLIES, ROUNDS = 2000, 1000, 2
PROGRAMS, CALLS = 400, 4000


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_no_damaged_graph_does_more_than_be_refused(seed: int) -> None:
    before = torch.get_rng_state()
    outcomes = [attempts.graph(Random(f"{seed}/{number}")) for number in range(GRAPHS)]
    assert torch.equal(torch.get_rng_state(), before)
    # If one of the three outcomes were rare, the damage would not test it.
    assert min(outcomes.count(outcome) for outcome in ("refused", "finding", "accepted")) > 20


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_no_damaged_reply_does_more_than_be_refused(seed: int) -> None:
    outcomes = [attempts.reply(Random(f"{seed}/{number}")) for number in range(REPLIES)]
    assert min(outcomes.count(outcome) for outcome in ("no program", "refused", "program")) > 20


def fuzzed(count: int, kind: str) -> dict[str, int]:
    """Outcomes from a fresh process. It forks, and this test process may have grown too large for that."""
    command = [sys.executable, "-m", "fuzz", str(count), "--only", kind]
    said = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, check=True).stdout
    return ast.literal_eval(said.removeprefix(kind))


def test_no_odd_program_does_more_than_be_refused() -> None:
    outcomes = fuzzed(PROGRAMS, "program")
    assert "crash" not in outcomes and min(outcomes["refused"], outcomes["finding"], outcomes["accepted"]) > 5


def test_no_call_with_hostile_numbers_ends_its_process() -> None:
    outcomes = fuzzed(CALLS, "call")
    assert "crash" not in outcomes and min(outcomes["ran"], outcomes["raised"], outcomes["refused"]) > 20


DEADLY = """
import os, signal
from fuzz.__main__ import counted

def deadly(random):
    if random.random() < 0.5:
        os.kill(os.getpid(), signal.SIGFPE)
    return "fine"

print(dict(counted(deadly, [f"0/{number}" for number in range(6)])))
"""


def test_a_crash_is_counted_and_named() -> None:
    fatal = [seed for seed in (f"0/{number}" for number in range(6)) if Random(seed).random() < 0.5]
    assert 0 < len(fatal) < 6
    said = subprocess.run([sys.executable, "-c", DEADLY], cwd=TESTS, capture_output=True, text=True, check=True).stdout
    *named, counted = said.splitlines()
    assert named == [f"CRASH deadly {seed}" for seed in fatal]
    assert ast.literal_eval(counted) == {"crash": len(fatal), "fine": 6 - len(fatal)}
