"""The lanes of a run: their results, scores and policies."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

from ..codec import DecodeError, convert, decode, encode, to_finite
from ..errors import StoreError, WorkerError
from ..types import Episodes, Evaluation, Lane, Peak, PolicyId, Ranges, Standing, TrainingResult
from ..worker import framed, unframed
from . import artifacts
from .db import Log, Row
from .rows import (
    damaged,
    decode_digest,
    decode_evaluation,
    decode_lane,
    decode_result,
    encode_evaluation,
    encode_lane,
    encode_result,
    policy_name,
)


class LaneLog(Log):
    """The lanes of a store. A lane is written when it begins; its result, scores and policies follow as they come."""

    def add(self, lanes: Iterable[Lane]) -> None:
        """Store the lanes that are about to train, except those that are stored already."""
        known = self.all()
        fresh = {lane.id: lane for lane in lanes if lane.id not in known}
        self._database.put("lanes", *map(encode_lane, fresh.values()))

    def all(self) -> dict[str, Lane]:
        """Every lane of the run by its id, trained or not, in the order in which they began."""
        return {row["lane"]: self._database.decoded(decode_lane, row) for row in self._database.rows("lanes")}

    def save_ranges(self, ranges: Mapping[str, Ranges]) -> None:
        """Store the ranges that lanes draw their worlds from, by name, except names that are stored already."""
        known = self.ranges()
        fresh = {name: own for name, own in ranges.items() if name not in known}
        self._database.put("ranges", *({"name": name, "ranges": encode(own)} for name, own in fresh.items()))

    def ranges(self) -> dict[str, Ranges]:
        """The stored ranges by name, in the order in which they were saved."""
        rows = self._database.rows("ranges")
        return {row["name"]: self._database.decoded(decode, Ranges, row["ranges"]) for row in rows}

    def save_results(self, results: Iterable[TrainingResult]) -> None:
        """Store the results of lanes that share one training: all or none of them."""
        rows: list[dict[str, object]] = []
        for result in results:
            folder = f"lanes/{result.lane}"
            text = encode_result(result)
            artifacts.write(self._directory, f"{folder}/curves.json", text)
            for name, policy in result.policies.items():
                artifacts.write(self._directory, f"{folder}/{name}.safetensors", policy)
            rows.append({"lane": result.lane, "fitness": to_finite(result.fitness), "result": text})
        self._database.put("results", *rows)

    def result(self, lane: str) -> TrainingResult | None:
        """The stored result. Its checkpoints hold no policies; `policy` reads those."""
        row = self._database.row("results", lane=lane)
        return self._database.decoded(decode_result, lane, row["result"]) if row is not None else None

    def results(self) -> dict[str, TrainingResult]:
        """Every stored result by lane id, as `result` returns it."""
        rows = self._database.rows("results")
        return {row["lane"]: self._database.decoded(decode_result, row["lane"], row["result"]) for row in rows}

    def policy(self, lane: str, peak: Peak) -> bytes | None:
        """One of the lane's policies (safetensors); None when it never had that one.

        Raises:
            StoreError: when its file is missing or is not what was written.
        """
        row = self._database.row("results", lane=lane)
        wanted = self._database.decoded(decode_digest, row["result"], peak) if row is not None else None
        if wanted is None:
            return None
        name = _policy_file(lane, peak)
        found = artifacts.read(self._directory, name)
        if damaged(found, wanted):
            where = self._directory / name
            raise StoreError(f"{where} is missing or damaged; restore it from a copy, or begin again in another dir=.")
        return found

    def has_policy(self, lane: str, peak: Peak) -> bool:
        """Whether the file of one of the lane's policies exists. It does not where only the rows were copied."""
        return artifacts.exists(self._directory, _policy_file(lane, peak))

    def save_best_policy(self, policy: PolicyId) -> None:
        """Store which policy of the run is the best, whatever it was trained with."""
        self._database.put("best_policy", {"id": 1, **policy._asdict()})

    def best_policy(self) -> PolicyId | None:
        """The best policy, whatever it was trained with; None before it is judged, and in runs without `polish=`."""
        row = self._database.row("best_policy")
        return self._database.decoded(convert, PolicyId, (row["lane"], row["peak"])) if row is not None else None

    def save_evaluations(self, scores: Iterable[Evaluation]) -> None:
        self._database.put("evaluations", *map(encode_evaluation, scores))

    def evaluations(self) -> dict[str, Evaluation]:
        return {row["lane"]: self._evaluation(row) for row in self._database.rows("evaluations")}

    def _evaluation(self, row: Row) -> Evaluation:
        return self._database.decoded(decode_evaluation, row)

    def save_plays(self, look: int, scores: Iterable[Evaluation]) -> None:
        """Store the scores that lanes are ranked by, and the recorded episodes.

        Args:
            look: 0 where the policies played for the first time, 1 where they played again.
        """
        scores = list(scores)
        for score in scores:
            if score.recorded is not None:
                bare = dataclasses.replace(score.recorded, states=b"")
                data = framed({"episodes": to_finite(bare)}, {"states": score.recorded.states})
                artifacts.write(self._directory, _episodes(score.lane), data)
        self._database.put("plays", *({"look": look} | encode_evaluation(score) for score in scores))

    def plays(self) -> dict[str, dict[Peak, tuple[Evaluation, ...]]]:
        """The scores that lanes are ranked by, by lane id and policy, in the order of the looks."""
        found: dict[str, dict[Peak, tuple[Evaluation, ...]]] = {}
        for row in self._database.rows("plays", order=("look", "rowid")):
            own = found.setdefault(row["lane"], {})
            own[row["peak"]] = (*own.get(row["peak"], ()), self._evaluation(row))
        return found

    def episodes(self, lane: str) -> Episodes | None:
        """The recorded episodes of a lane; None where there are none, or their file is damaged."""
        data = artifacts.read(self._directory, _episodes(lane))
        try:
            frame = unframed(data or b"")
            found = dataclasses.replace(convert(Episodes, frame.header["episodes"]), states=frame.blobs["states"])
        except (WorkerError, DecodeError, KeyError):
            return None
        return found if len(found.fitness) == len(found.steps) else None

    def save_rung(self, rung: int, standings: Iterable[Standing]) -> None:
        """Store the standings of lanes that paused, all at once: they are compared to decide which lanes train on."""
        rows = ({"rung": rung, "went_on": s.went_on} | encode_evaluation(s.played) for s in standings)
        self._database.put("rungs", *rows)

    def rungs(self) -> dict[str, dict[int, Standing]]:
        """The standing of each lane, by lane id and rung."""
        found: dict[str, dict[int, Standing]] = {}
        for row in self._database.rows("rungs", order=("rung", "rowid")):
            standing = Standing(self._evaluation(row), bool(row["went_on"]))
            found.setdefault(row["lane"], {})[row["rung"]] = standing
        return found

    def pause(self, rung: int, result: TrainingResult) -> None:
        """Store the state of a lane that paused, to continue from. It replaces the state of an earlier rung."""
        data = framed({"rung": rung, "result": to_finite(result.holding({}))}, result.blobs)
        artifacts.write(self._directory, _paused(result.lane), data)

    def paused(self, rung: int, lane: str) -> TrainingResult | None:
        """What `pause` stored. None where the lane did not pause at this rung, or its file is damaged: the lane then
        begins anew."""
        data = artifacts.read(self._directory, _paused(lane))
        try:
            frame = unframed(data or b"")
            result = convert(TrainingResult, frame.header["result"])
        except (WorkerError, DecodeError, KeyError):
            return None
        if frame.header.get("rung") != rung or result.lane != lane:
            return None
        return result.holding(frame.blobs)

    def forget(self, lane: str) -> None:
        """Delete the paused state of a lane, which nothing needs once the lane has its result."""
        artifacts.remove(self._directory, _paused(lane))

    def save_tryout(self, name: str, evaluation: Evaluation) -> None:
        """Keep what a lane's policy scored in the tryout `name` (see `method.hacking.tryouts`)."""
        # The table keeps its old name, `trials`: to rename it would take a new schema.
        self._database.put("trials", {"name": name} | encode_evaluation(evaluation))

    def tryouts(self) -> dict[str, dict[str, Evaluation]]:
        """Scores by lane id and name of the tryout."""
        found: dict[str, dict[str, Evaluation]] = {}
        for row in self._database.rows("trials"):
            found.setdefault(row["lane"], {})[row["name"]] = self._evaluation(row)
        return found


def _paused(lane: str) -> str:
    return f"lanes/{lane}/paused.frame"


def _episodes(lane: str) -> str:
    return f"lanes/{lane}/episodes.frame"


def _policy_file(lane: str, peak: Peak) -> str:
    return f"lanes/{lane}/{policy_name(peak)}.safetensors"
