"""From pairwise preferences to a ranking."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence
from typing import TypeVar

Item = TypeVar("Item", bound=Hashable)

PRIOR = 0.1
"""Wins, and as many losses, that each item is given against an imagined one of strength 1: without them, who never lost
would be infinitely strong, and groups that were never compared would share no scale."""
_ROUNDS = 1000
_CLOSE = 1e-9


def strengths(votes: Sequence[tuple[Item, Item]]) -> dict[Item, float]:
    """Bradley-Terry strengths of the items that took part in (winner, loser) votes: P(a beats b) = a / (a + b).

    The maximum of the posterior, by the MM iterations of Hunter (2004), "MM algorithms for generalized Bradley-Terry
    models", equation 3: strength = wins / sum over comparisons of 1 / (own + other strength).
    """
    wins = Counter(winner for winner, _ in votes)
    met = Counter((a, b) for pair in votes for a, b in (pair, pair[::-1]))
    found = {item: 1.0 for pair in votes for item in pair}
    for _ in range(_ROUNDS):
        before = dict(found)
        for item, own in before.items():
            meetings = sum(count / (own + before[b]) for (a, b), count in met.items() if a == item)
            found[item] = (wins[item] + PRIOR) / (meetings + 2 * PRIOR / (own + 1.0))
        if all(abs(found[item] - before[item]) < _CLOSE * before[item] for item in found):
            break
    return found
