"""The rewards of a run: their programs, verdicts and names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..codec import encode
from ..types import OWN_REWARDS, Attempt, Candidate, CandidateId, Message, Reply, RewardProgram, Verdict
from . import artifacts
from .db import Log
from .rows import decode_messages, decode_verdict, encode_messages


class RewardLog(Log):
    """Reward programs with their verdicts, which replies hold them, and the names of rewards that no model wrote."""

    def save_attempt(
        self, generation: int, attempt: int, slot: int, candidate: CandidateId | None, repair: Sequence[Message]
    ) -> None:
        """Store which program a reply holds, once that is judged, and what a repair showed beyond the slot's prompt."""
        place = {"generation": generation, "attempt": attempt, "slot": slot}
        if self._database.row("attempts", **place) is None:
            shown = encode_messages(repair) if repair else None
            self._database.put("attempts", {**place, "candidate": candidate, "repair": shown})

    def attempts(self) -> dict[tuple[int, int, int], Attempt]:
        """Every judged reply, by generation, attempt and slot."""
        return {
            (row["generation"], row["attempt"], row["slot"]): Attempt(
                candidate=self.candidate(row["candidate"]),
                repair=self._database.decoded(decode_messages, row["repair"]) if row["repair"] is not None else (),
            )
            for row in self._database.rows("attempts")
        }

    def save_verdict(self, candidate: Candidate, verdict: Verdict, reply: Reply) -> None:
        """`reply` is the first one that held this program."""
        folder = f"candidates/{candidate.id}"
        artifacts.write(self._directory, f"{folder}/reward.py", candidate.source)
        artifacts.write(self._directory, f"{folder}/reply.txt", reply.text)
        artifacts.write(self._directory, f"{folder}/verdict.json", encode(verdict, indent=2))
        row = {"candidate": candidate.id, "source": candidate.source, "verdict": encode(verdict)}
        self._database.put("verdicts", row)

    def verdict(self, candidate: str) -> Verdict | None:
        row = self._database.row("verdicts", candidate=candidate)
        return self._database.decoded(decode_verdict, row["verdict"]) if row is not None else None

    def save_named(self, rewards: Mapping[str, CandidateId | None]) -> None:
        """Store the names of rewards; `human` and `sparse`, which come with the task, are no candidates."""
        self._database.put("given", *({"name": name, "candidate": own} for name, own in rewards.items()))

    def named(self) -> dict[str, CandidateId | None]:
        """Rewards that no model wrote, by name, in the order in which they were stored: those that a person gave, and
        weightings of one that tuning made."""
        return {row["name"]: row["candidate"] for row in self._database.rows("given")}

    def texts(self) -> dict[str, Candidate]:
        """The programs of the named rewards that have one."""
        found = {name: self.candidate(own) for name, own in self.named().items()}
        return {name: candidate for name, candidate in found.items() if candidate is not None}

    def program(self, reward: str) -> RewardProgram | None:
        """The program of a reward, by its id or its name, as it trains; None for one that was refused."""
        name = self.named().get(reward) or reward
        verdict = self.verdict(name)
        own = name if name in OWN_REWARDS else None
        return verdict.graph if verdict is not None else own

    def candidate(self, identity: CandidateId | None) -> Candidate | None:
        """A judged program; None where nothing of that name was judged."""
        row = self._database.row("verdicts", candidate=identity) if identity is not None else None
        return Candidate(id=row["candidate"], source=row["source"]) if row is not None else None
