"""A confined child's answer is untrusted data: it is read whole or not at all, and its text is cleaned."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
import torch

from openeureka.codec import encode
from openeureka.reward import gate
from openeureka.sandbox import client, server
from openeureka.sandbox.answer import Answer
from openeureka.sandbox.client import Sandbox
from openeureka.testing.hostile import STATE
from openeureka.types import Candidate, Finding, Node, RewardGraph
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
    assert server._examine(said, BENCH) == Answer.read(said) == Answer()


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


def test_a_program_that_does_something_else_with_the_worlds_of_the_training_is_refused() -> None:
    lines = ("scale = 1.0 if num_envs <= 256 else 2.0", "return scale * pos[:, 0], {}")
    text = "\n    ".join(("def compute_reward(pos, num_envs):", *lines))
    program = gate.check(text, STATE)
    assert isinstance(program, gate.Program)
    assert server._probe(program, replace(BENCH, worlds=128)).findings == ()
    with Sandbox(STATE, recorded(), worlds=512) as sandbox:  # the server must be told the number
        assert sandbox.check(Candidate.of(text)).findings[0].rule == "world-count"


@pytest.mark.parametrize("picked", [[], [70], [5, 70], [70, 160], [5, 70, 160, 230], [5, 6, 70]])
@pytest.mark.parametrize("edit", ["r[m] += 1.0", "r[m] *= 2.0", "r[m] = 10.0 * pos[:, 1][m]", "r[m] = 5.0"])
def test_an_edit_behind_a_mask_is_accepted_however_many_worlds_it_picks(picked: list[int], edit: str) -> None:
    states = {**recorded(), "phase": torch.zeros(256).index_fill(0, torch.tensor(picked, dtype=torch.int64), 1.0)}
    lines = ("r = pos[:, 0].clone()", "m = phase > 0.5", edit, "return r, {}")
    program = gate.check("\n    ".join(("def compute_reward(pos, phase):", *lines)), STATE)
    assert isinstance(program, gate.Program)
    assert server._probe(program, replace(BENCH, recorded=states)).findings == ()
