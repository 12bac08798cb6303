"""What a confined child answers is data of a stranger: it is read whole or not at all, and cleaned for people."""

from __future__ import annotations

import json
from typing import Any

import pytest

from openeureka.codec import encode
from openeureka.sandbox import client, server
from openeureka.sandbox.answer import Answer
from openeureka.testing.hostile import STATE
from openeureka.types import Finding, Node, RewardGraph
from sandbox.states import recorded

BENCH = server._Bench(STATE, recorded(), worlds=0, confined=False)
GOOD = RewardGraph(
    nodes=(Node("input", ("phase",)), Node("neg.default", ({"ref": 0},))), reward=1, components=(("r", 1),)
)


def answer(**changes: Any) -> bytes:
    return json.dumps(json.loads(encode(Answer(graph=GOOD, lines=(1, 2)))) | changes).encode()


def test_an_honest_answer_is_a_graph() -> None:
    assert server._examine(answer(), BENCH).graph == GOOD


@pytest.mark.parametrize(
    "said",
    [
        b"",
        b"\xff" * 8,
        b"[]",
        b'"accepted"',
        b"[" * 100_000,
        b'{"graph": ' * 100_000,
        b'{"lines": [' + b"1" * 5000 + b"]}",
        answer(graph="{}"),
        answer(graph={"nodes": 1}),
        answer(lines="x" * 9),
        answer(lines=[0.5]),
        answer(findings={"a": "b"}),
        answer(findings=[["rule", "message", "fix", 3]]),
        answer(findings=[{"rule": 1, "message": "m"}]),
        answer(returns=True),
    ],
)
def test_an_answer_of_another_form_says_nothing(said: bytes) -> None:
    assert server._examine(said, BENCH) == client._parse(said) == Answer()


def test_a_forged_operation_is_named_by_both_readers() -> None:
    forged = RewardGraph(nodes=(Node("from_file.default", ("/etc/passwd",)),), reward=0, components=())
    (finding,) = server._examine(encode(Answer(graph=forged)).encode(), BENCH).findings
    _, (again,), accepted = client._accepted(forged)
    assert accepted is None
    assert finding.rule == again.rule == "operation"
    assert "from_file.default" in finding.message and "from_file.default" in again.message


def test_findings_of_a_stranger_are_one_printable_line() -> None:
    words = "\x1b[2J\u202e\n<b> \ud800"
    found = client._cleaned(Finding(rule="X" * 99, message=words + "y" * 9999, fix=words, line=10**9))
    assert (found.rule, found.line) == ("error", None)
    assert found.sentence().isprintable() and len(found.message) == 500
