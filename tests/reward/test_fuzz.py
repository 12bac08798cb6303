"""Damaged and forged graphs and replies are refused or harmless: none of ten thousand ends in another error.

A longer run with other seeds: `python -m openeureka.testing.fuzz 100000 --seed 7`.
"""

from __future__ import annotations

from random import Random

import pytest
import torch

from openeureka.testing import fuzz

GRAPHS, REPLIES, ROUNDS = 2000, 1000, 4


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
