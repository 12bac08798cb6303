"""Nouns as JSON and back: what is written is strict JSON, and anything that is not such a noun is one error."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest

from openeureka.codec import DecodeError, convert, decode, encode
from openeureka.store.rows import decode_result, decode_verdict, encode_result
from openeureka.types import (
    Checkpoint,
    Evaluation,
    Finding,
    LaneSpec,
    Message,
    Node,
    RewardGraph,
    StateSpec,
    StateVar,
    TrainingProgress,
    TrainingResult,
    TrainingState,
    Verdict,
    VerdictCode,
)

GRAPH = RewardGraph(
    nodes=(
        Node("input", ("pos",)),
        Node("clamp.default", ({"ref": 0}, -math.inf, 10**18)),
        Node("sum.dim_IntList", ({"ref": 1}, (1,)), {"keepdim": False, "dtype": None}),
        Node("constant", ((1.0, math.inf, 2), (3,), "float32")),
        Node("index.Tensor", ({"ref": 0}, (None, {"ref": 3}))),
        Node("zeros.default", (({"n": 1}, 2),)),
    ),
    reward=2,
    components=(("x", 1),),
)
VERDICT = Verdict(
    candidate="a1",
    code=VerdictCode.ACCEPTED,
    findings=(Finding(rule="r", message="half a \ud800 and \0", line=3),),
    graph=GRAPH,
    seconds=0.5,
)
RESULT = TrainingResult(
    lane="a-s0",
    state=TrainingState.FINISHED,
    fitness=1.5,
    curves={"fitness": (None, 1.5)},
    env_steps=64,
    seconds=2.0,
    clock=(1.0, 2.0),
    best_fitness=Checkpoint(epoch=1, value=1.5),
)
NOUNS = (
    GRAPH,
    VERDICT,
    RESULT,
    Evaluation(lane="a", fitness=None, episode_length=3.0, episodes=4, peak="last"),
    Message("user", "\U0001f600 \ud800"),
    StateSpec((StateVar(name="pos", meaning="where", shape=(3,)), StateVar(name="dt", meaning="[s]", kind="float"))),
    LaneSpec(id="a", program=GRAPH, seed=2),
    LaneSpec(id="b", program="human", start=b"\x00\xff"),
    TrainingProgress(epoch=1, epochs=2, env_steps_per_second=math.inf, fitness={"a": None, "b": 1.0}),
)


@pytest.mark.parametrize("noun", NOUNS, ids=lambda noun: type(noun).__name__)
def test_a_noun_comes_back_from_strict_ascii(noun: Any) -> None:
    text = encode(noun)
    json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert text.isascii() and "\0" not in text
    assert decode(type(noun), text) == noun


def test_the_graph_of_a_verdict_is_a_graph_by_itself() -> None:
    assert decode(RewardGraph, json.dumps(json.loads(encode(VERDICT))["graph"])) == GRAPH


OLD = """{"candidate": "a1", "code": "accepted", "findings": [{"rule": "r", "message": "m", "fix": "", "line": null}],
"graph": {"nodes": [{"op": "input", "args": ["pos"], "kwargs": {}},
                    {"op": "full.default", "args": [[{"n": 1}], Infinity], "kwargs": {"dtype": "float32"}}],
          "reward": 1, "components": [["x", 1]]}, "seconds": 0.5}"""


def test_a_verdict_of_an_older_version_is_read_and_its_infinity_with_it() -> None:
    found = decode_verdict(OLD).graph
    assert found is not None
    assert found.nodes[1] == Node("full.default", (({"n": 1},), math.inf), {"dtype": "float32"})
    assert decode_verdict(encode(decode_verdict(OLD))) == decode_verdict(OLD)


def test_a_result_of_an_older_version_is_read() -> None:
    data = json.loads(encode_result(RESULT))
    older = {name: data[name] for name in data if name not in ("lane", "clock", "last")}
    older["best_fitness"] = {"epoch": 1, "value": 1.5}
    found = decode_result("a-s0", json.dumps(older))
    assert (found, found.clock) == (RESULT, ())


def changed(noun: object, **changes: object) -> str:
    return json.dumps(json.loads(encode(noun)) | changes)


VERDICTS = {
    "nothing": "",
    "no UTF-8": b"\xff",
    "arrays without end": "[" * 100_000,
    "objects without end": '{"a":' * 100_000,
    "a field without end": '{"candidate": "a", "code": "crashed", "findings": ' + "[" * 100_000,
    "digits without end": changed(VERDICT, seconds=0).replace('"seconds": 0', '"seconds": ' + "1" * 5000),
    "a time without end": changed(VERDICT, seconds=10**400),
    "a time beyond all numbers": changed(VERDICT, seconds=0).replace('"seconds": 0', '"seconds": 1e999'),
    "no time": changed(VERDICT, seconds=None),
    "an infinite time": changed(VERDICT, seconds=math.inf),
    "an infinite time, spelled": changed(VERDICT, seconds={"float": "inf"}),
    "a true time": changed(VERDICT, seconds=True),
    "a path": changed(VERDICT, candidate="../a"),
    "a code nobody knows": changed(VERDICT, code="harmless"),
    "another version": changed(VERDICT, graph=json.loads(encode(GRAPH)) | {"version": 2}),
    "an operation that is no text": changed(VERDICT, graph=json.loads(encode(GRAPH)) | {"nodes": [{"op": []}]}),
    "arguments in arguments": changed(
        VERDICT, graph=json.loads(encode(GRAPH)) | {"nodes": [{"op": "input", "args": [[[1]]]}]}
    ),
    "a negative line": changed(VERDICT, findings=[{"rule": "a", "message": "b", "line": -1}]),
}


@pytest.mark.parametrize("name", VERDICTS)
def test_what_is_no_verdict_is_one_error(name: str) -> None:
    with pytest.raises(DecodeError) as error:
        decode(Verdict, VERDICTS[name])
    assert len(str(error.value)) <= 200 and str(error.value).isprintable()


@pytest.mark.parametrize(
    "changes",
    [
        {"seconds": None},
        {"env_steps": -1},
        {"env_steps": 2**53},
        {"env_steps": 1.5},
        {"fitness": math.nan},
        {"curves": {"fitness": [math.inf, 1.5]}},
        {"curves": {"fitness": [None, True]}},
        {"curves": {"half \ud800": []}},
        {"best_fitness": {"epoch": 1, "value": None}},
        {"best_fitness": {"epoch": 2, "value": 1.5}},
    ],
)
def test_a_result_with_a_value_that_none_has_is_refused(changes: dict[str, object]) -> None:
    with pytest.raises(DecodeError):
        decode_result("a-s0", json.dumps(json.loads(encode_result(RESULT)) | changes))


def test_data_that_is_nested_without_end_is_no_noun() -> None:
    deep: list[Any] = []
    for _ in range(100_000):
        deep = [deep]
    with pytest.raises(DecodeError):
        convert(LaneSpec, {"id": "a", "program": {"nodes": [{"op": "input", "args": deep}]}})
