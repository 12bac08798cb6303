"""Every lane of a run: what trained, and what came of it, also of a stage of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..codec import DecodeError, decode, defined, encode, shaped
from ..errors import StoreError, WorkerError
from ..types import Episodes, Evaluation, Lane, Peak, PolicyId, Ranges, Standing, TrainingResult
from ..worker import framed, unframed
from . import artifacts
from .db import Database
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


class LaneLog:
    """Lanes of a store, each written when it begins; results, scores and policies when they are there."""

    def __init__(self, database: Database) -> None:
        self._database = database

    @property
    def _directory(self) -> Path:
        return self._database.directory

    def add(self, lanes: Iterable[Lane]) -> None:
        """Keep what is about to train, where the run does not know it yet."""
        known = self.all()
        fresh = {lane.id: lane for lane in lanes if lane.id not in known}
        self._database.put("lanes", *map(encode_lane, fresh.values()))

    def all(self) -> dict[str, Lane]:
        """Every lane of the run by its id, trained or not, in the order in which they began."""
        rows = [dict(row) for row in self._database.rows("lanes")]
        return {row["lane"]: self._database.decoded(decode_lane, row) for row in rows}

    def save_ranges(self, ranges: Mapping[str, Ranges]) -> None:
        """Keep what lanes draw their worlds from, by name, as far as the run does not know the name."""
        known = self.ranges()
        fresh = {name: own for name, own in ranges.items() if name not in known}
        self._database.put("ranges", *({"name": name, "ranges": encode(own)} for name, own in fresh.items()))

    def ranges(self) -> dict[str, Ranges]:
        """What `save_ranges` kept, in its order."""
        rows = self._database.rows("ranges")
        return {row["name"]: self._database.decoded(decode, Ranges, row["ranges"]) for row in rows}

    def save_results(self, results: Iterable[TrainingResult]) -> None:
        """Keep what lanes found that trained as one: all or none of them."""
        rows: list[dict[str, object]] = []
        for result in results:
            folder = f"lanes/{result.lane}"
            text = encode_result(result)
            artifacts.write(self._directory, f"{folder}/curves.json", text)
            for name, policy in result.policies.items():
                artifacts.write(self._directory, f"{folder}/{name}.safetensors", policy)
            rows.append({"lane": result.lane, "fitness": defined(result.fitness), "result": text})
        self._database.put("results", *rows)

    def result(self, lane: str) -> TrainingResult | None:
        """The stored result, its checkpoints without policies: `policy` reads those."""
        row = self._database.row("results", lane=lane)
        return self._database.decoded(decode_result, lane, row["result"]) if row is not None else None

    def results(self) -> dict[str, TrainingResult]:
        """By lane, as `result` has them."""
        rows = self._database.rows("results")
        return {row["lane"]: self._database.decoded(decode_result, row["lane"], row["result"]) for row in rows}

    def policy(self, lane: str, peak: Peak) -> bytes | None:
        """One of the lane's policies (safetensors); None when it never had that one.

        Raises:
            StoreError: when its file is not the one that was written.
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
        """Whether the file of one of the lane's policies is there: not where the rows alone were copied."""
        return artifacts.exists(self._directory, _policy_file(lane, peak))

    def save_best_policy(self, policy: PolicyId) -> None:
        """Keep which policy is the best of all, judged as it is."""
        self._database.put("best_policy", {"id": 1, **policy._asdict()})

    def best_policy(self) -> PolicyId | None:
        """The best policy, whatever made it; None before it is judged, and where none was carried on."""
        row = self._database.row("best_policy")
        return self._database.decoded(shaped, PolicyId, (row["lane"], row["peak"])) if row is not None else None

    def save_evaluations(self, scores: Iterable[Evaluation]) -> None:
        self._database.put("evaluations", *map(encode_evaluation, scores))

    def evaluations(self) -> dict[str, Evaluation]:
        return {row["lane"]: self._evaluation(dict(row)) for row in self._database.rows("evaluations")}

    def _evaluation(self, row: dict[str, Any]) -> Evaluation:
        return self._database.decoded(decode_evaluation, row)

    def save_plays(self, look: int, scores: Iterable[Evaluation]) -> None:
        """Keep what policies of lanes scored when they were played to choose by, the first time or again, and recorded
        episodes."""
        scores = list(scores)
        for score in scores:
            if score.recorded is not None:
                bare = dataclasses.replace(score.recorded, states=b"")
                data = framed({"episodes": defined(bare)}, {"states": score.recorded.states})
                artifacts.write(self._directory, _episodes(score.lane), data)
        self._database.put("plays", *({"look": look} | encode_evaluation(score) for score in scores))

    def plays(self) -> dict[str, dict[Peak, tuple[Evaluation, ...]]]:
        """Scores by lane id and policy, a look after the other."""
        found: dict[str, dict[Peak, tuple[Evaluation, ...]]] = {}
        for row in self._database.rows("plays", order=("look", "rowid")):
            score = dict(row)
            del score["look"]
            own = found.setdefault(row["lane"], {})
            own[row["peak"]] = (*own.get(row["peak"], ()), self._evaluation(score))
        return found

    def episodes(self, lane: str) -> Episodes | None:
        """The recorded ones of a lane; None where there are none, or their file is damaged."""
        data = artifacts.read(self._directory, _episodes(lane))
        try:
            frame = unframed(data or b"")
            found = dataclasses.replace(shaped(Episodes, frame.header["episodes"]), states=frame.blobs["states"])
        except (WorkerError, DecodeError, KeyError):
            return None
        return found if len(found.fitness) == len(found.steps) else None

    def save_rung(self, rung: int, standings: Iterable[Standing]) -> None:
        """Keep how lanes stood where they paused, all of them at once: who goes on is decided among them."""
        rows = ({"rung": rung, "went_on": s.went_on} | encode_evaluation(s.played) for s in standings)
        self._database.put("rungs", *rows)

    def rungs(self) -> dict[str, dict[int, Standing]]:
        """How each lane stood, by lane id and rung."""
        found: dict[str, dict[int, Standing]] = {}
        for row in self._database.rows("rungs", order=("rung", "rowid")):
            score = dict(row)
            rung, went_on = score.pop("rung"), bool(score.pop("went_on"))
            found.setdefault(row["lane"], {})[rung] = Standing(self._evaluation(score), went_on)
        return found

    def pause(self, rung: int, result: TrainingResult) -> None:
        """Keep a lane that paused, with all that it goes on from, in place of what it left at an earlier rung."""
        data = framed({"rung": rung, "result": defined(result.holding({}))}, result.blobs)
        artifacts.write(self._directory, _paused(result.lane), data)

    def paused(self, rung: int, lane: str) -> TrainingResult | None:
        """What `pause` kept; None where the lane is not at this rung, or its file is damaged: then it begins anew."""
        data = artifacts.read(self._directory, _paused(lane))
        try:
            frame = unframed(data or b"")
            result = shaped(TrainingResult, frame.header["result"])
        except (WorkerError, DecodeError, KeyError):
            return None
        if frame.header.get("rung") != rung or result.lane != lane:
            return None
        return result.holding(frame.blobs)

    def forget(self, lane: str) -> None:
        """The lane has its result: nobody goes on from where it paused."""
        if artifacts.exists(self._directory, _paused(lane)):
            artifacts.remove(self._directory, _paused(lane))

    def save_tryout(self, name: str, evaluation: Evaluation) -> None:
        """Keep what a lane's policy scored in the tryout `name` (see `method.hacking.tryouts`)."""
        # Files keep the name that the table had: another one would be another schema.
        self._database.put("trials", {"name": name} | encode_evaluation(evaluation))

    def tryouts(self) -> dict[str, dict[str, Evaluation]]:
        """Scores by lane id and name of the tryout."""
        found: dict[str, dict[str, Evaluation]] = {}
        for row in self._database.rows("trials"):
            score = dict(row)
            name = score.pop("name")
            found.setdefault(row["lane"], {})[name] = self._evaluation(score)
        return found


def _paused(lane: str) -> str:
    return f"lanes/{lane}/paused.frame"


def _episodes(lane: str) -> str:
    return f"lanes/{lane}/episodes.frame"


class StageFiles:
    """Remembers stages as `lanes/<lane>/stage<number>.json` and, of a lane that goes on, its last policy beside it.

    The policy comes first: a stage whose JSON is there is whole. One that cannot be read is not finished, nor is one
    whose policy is not the one that was written.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory

    def save(self, stage: int, result: TrainingResult) -> None:
        if result.last is not None:
            artifacts.write(self._directory, self._name(stage, result.lane, "safetensors"), result.last)
        artifacts.write(self._directory, self._name(stage, result.lane, "json"), encode_result(result))

    def read(self, stage: int, lane: str) -> TrainingResult | None:
        """The result with its last policy, the others empty; None when the stage was not finished."""
        text = artifacts.read(self._directory, self._name(stage, lane, "json"))
        if text is None:
            return None
        last = artifacts.read(self._directory, self._name(stage, lane, "safetensors"))
        try:
            result, wanted = decode_result(lane, text), decode_digest(text, "last")
        except DecodeError:
            return None
        if wanted is not None and damaged(last, wanted):
            return None
        return result.holding({"last": last} if last is not None else {})

    def _name(self, stage: int, lane: str, suffix: str) -> str:
        return f"lanes/{lane}/stage{stage}.{suffix}"


def _policy_file(lane: str, peak: Peak) -> str:
    return f"lanes/{lane}/{policy_name(peak)}.safetensors"
