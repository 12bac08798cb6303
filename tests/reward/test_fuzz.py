"""Damaged and forged graphs and replies are refused or harmless: none of ten thousand ends in another error.

A longer run with other seeds: `python -m openeureka.testing.fuzz 100000 --seed 7`.
"""

from __future__ import annotations

import os
import signal
from random import Random

import pytest
import torch

from openeureka.testing import fuzz

GRAPHS, REPLIES, ROUNDS = 2000, 1000, 4
PROGRAMS, CALLS = 400, 4000


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_no_damaged_graph_does_more_than_be_refused(seed: int) -> None:
    before = torch.get_rng_state()
    outcomes = [fuzz.graph(Random(f"{seed}/{number}")) for number in range(GRAPHS)]
    assert torch.equal(torch.get_rng_state(), before)
    # Each of the three happens often, or the damage is not what it is meant to be.
    assert min(outcomes.count(outcome) for outcome in ("refused", "finding", "accepted")) > 20


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_no_damaged_reply_does_more_than_be_refused(seed: int) -> None:
    outcomes = [fuzz.reply(Random(f"{seed}/{number}")) for number in range(REPLIES)]
    assert min(outcomes.count(outcome) for outcome in ("no program", "refused", "program")) > 20


def test_no_odd_program_does_more_than_be_refused() -> None:
    outcomes = fuzz._counted(fuzz.program, [f"0/{number}" for number in range(PROGRAMS)])
    assert outcomes["crash"] == 0 and min(outcomes["refused"], outcomes["finding"], outcomes["accepted"]) > 5


def test_no_call_with_hostile_numbers_ends_its_process() -> None:
    outcomes = fuzz._counted(fuzz.call, [f"0/{number}" for number in range(CALLS)])
    assert outcomes["crash"] == 0 and min(outcomes["ran"], outcomes["raised"], outcomes["refused"]) > 20


def test_a_crash_is_counted_and_named(capfd: pytest.CaptureFixture[str]) -> None:
    def deadly(random: Random) -> str:
        if random.random() < 0.5:
            os.kill(os.getpid(), signal.SIGFPE)
        return "fine"

    seeds = [f"0/{number}" for number in range(6)]
    fatal = [seed for seed in seeds if Random(seed).random() < 0.5]
    assert 0 < len(fatal) < 6
    assert fuzz._counted(deadly, seeds) == {"crash": len(fatal), "fine": 6 - len(fatal)}
    assert capfd.readouterr().out.split("\n")[:-1] == [f"CRASH deadly {seed}" for seed in fatal]
