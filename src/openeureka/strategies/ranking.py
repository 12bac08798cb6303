"""Ranks rewards by score, or by the votes of a person; knows which ones that person rejected or chose."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from typing import NamedTuple, TypeVar

from ..score import excess
from ..types import CandidateId, Generation, History, Place, RemarkKind, Scored

Item = TypeVar("Item", bound=Hashable)
PRIOR = 0.1
"""Wins, and as many losses, that each item is given against an imagined one of strength 1: without them, an item that
never lost would be infinitely strong, and groups that were never compared would share no scale."""
_ROUNDS = 1000
_CLOSE = 1e-9


class Record(NamedTuple):
    """A candidate's comparisons with others."""

    won: int
    lost: int


class Ranking:
    """The order of a history's entries. Equal programs share all remarks of a person on any of them."""

    def __init__(self, history: History) -> None:
        self._generations, self._limits = history.generations, history.limits
        self._entries = {entry.sample.place: entry for entry in history.entries}
        self._votes = [vote for generation in history.generations for vote in self._compared(generation)]
        self.strengths = strengths(self._votes)
        """Bradley-Terry strength by candidate id, of those that took part in a vote."""
        # Where a task never defines F, there is nothing but votes to judge by.
        scored = any(entry.score is not None for entry in self._entries.values())
        self.by_votes = history.judge == "votes" or (bool(self._votes) and not scored)
        vetoed = self._named(RemarkKind.VETO, history.generations)
        self.vetoed = tuple({entry.sample.place: entry for entry in vetoed}.values())
        """Rejected for good, in the order of the vetoes."""
        self.rejected = frozenset(entry.candidate_id for entry in self.vetoed)

    @property
    def best(self) -> Scored | None:
        """The entry that ranks first, the earlier of equals. None if nothing trained, or all was rejected or breaks a
        limit."""
        return self.best_of(self._entries.values())

    @property
    def nearest(self) -> Scored | None:
        """Where every policy breaks a limit, the entry that is least beyond it."""
        entries = [e for e in self._entries.values() if e.played is not None and self._stands(e)]
        if not self._limits or self.best is not None:
            return None
        return min(entries, key=lambda e: excess(e.played, self._limits) if e.played else math.inf, default=None)

    @property
    def winners(self) -> tuple[Scored, ...]:
        """The best of each generation that has one, oldest first."""
        found = (self.best_of(generation.entries) for generation in self._generations)
        return tuple(entry for entry in found if entry is not None)

    @property
    def favourite(self) -> Scored | None:
        """The entry that a person, after the last generation, chose as the next parent."""
        chosen = self._named(RemarkKind.FAVOURITE, self._generations[-1:])
        return next((e for e in reversed(chosen) if e.candidate_id not in self.rejected), None)

    def record(self, candidate: CandidateId) -> Record:
        return Record(
            won=sum(winner == candidate for winner, _ in self._votes),
            lost=sum(loser == candidate for _, loser in self._votes),
        )

    def best_of(self, entries: Iterable[Scored]) -> Scored | None:
        """The entry that ranks first of some of the history's entries, by the rules of `best`."""
        return max(filter(self._may_win, entries), key=self.worth, default=None)

    def worth(self, entry: Scored | None) -> tuple[float, float]:
        """A key to rank by. Where votes count, they come before the score; an entry without comparisons is below all
        that have some. None is below all entries."""
        undecided = -math.inf
        if entry is None:
            return undecided, undecided
        strength = self.strengths.get(entry.candidate_id, undecided) if self.by_votes else undecided
        return strength, entry.score if entry.score is not None else -math.inf

    def _may_win(self, entry: Scored) -> bool:
        return self._stands(entry) and not entry.breaks(self._limits)

    def _stands(self, entry: Scored) -> bool:
        trained = entry.trained if self.by_votes else entry.score is not None
        return trained and entry.candidate_id not in self.rejected

    def _compared(self, generation: Generation) -> Iterable[tuple[CandidateId, CandidateId]]:
        """Winner and loser of each vote after a generation; a favourite wins against its whole generation."""
        for remark in generation.remarks:
            if remark.place is None:
                continue
            winner = self._id(remark.place)
            others = [remark.over] if remark.over is not None else []
            if remark.kind is RemarkKind.FAVOURITE:
                others = [e.sample.place for e in self._generations[remark.place.generation].entries if e.trained]
            yield from ((winner, self._id(other)) for other in others if self._id(other) != winner)

    def _named(self, kind: RemarkKind, generations: Sequence[Generation]) -> list[Scored]:
        """The entries that remarks of one kind are about, in the order of the remarks."""
        remarks = [remark for generation in generations for remark in generation.remarks if remark.kind is kind]
        return [self._entries[remark.place] for remark in remarks if remark.place is not None]

    def _id(self, place: Place) -> CandidateId:
        return self._entries[place].candidate_id


def strengths(votes: Sequence[tuple[Item, Item]]) -> dict[Item, float]:
    """Bradley-Terry strengths of the items that took part in (winner, loser) votes: P(a beats b) = a / (a + b).

    They maximise the posterior, found by the MM iterations of Hunter (2004), "MM algorithms for generalized
    Bradley-Terry models", equation 3: strength = wins / sum over comparisons of 1 / (own + other strength).
    """
    wins = Counter(winner for winner, _ in votes)
    met: dict[Item, Counter[Item]] = {item: Counter() for pair in votes for item in pair}
    for winner, loser in votes:
        met[winner][loser] += 1
        met[loser][winner] += 1
    found = dict.fromkeys(met, 1.0)
    for _ in range(_ROUNDS):
        before = dict(found)
        for item, own in before.items():
            meetings = sum(count / (own + before[b]) for b, count in met[item].items())
            found[item] = (wins[item] + PRIOR) / (meetings + 2 * PRIOR / (own + 1.0))
        if all(abs(found[item] - before[item]) < _CLOSE * before[item] for item in found):
            break
    return found
