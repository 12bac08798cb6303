"""Ordinary replies of language models, on the real tasks: all but a few of them end as a graph that may train."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest

from openeureka.llm import extract
from openeureka.reward import examine, gate, load, probe
from openeureka.reward.states import Recorded
from openeureka.reward.trace import Refused
from openeureka.tasks import registry
from openeureka.tasks.record import record_states
from reward.honest import PROGRAMS

REPLIES = {
    f"{path.stem}-{number}": (path.stem, text)
    for path in sorted((Path(__file__).parent / "replies").glob("*.md"))
    for number, text in enumerate(path.read_text(encoding="utf-8").split("\n=====\n"))
}


@functools.cache
def states(env: str) -> Recorded:
    return record_states(env, worlds=16, steps=12)


@pytest.mark.parametrize("name", REPLIES)
def test_an_ordinary_reply_ends_as_a_graph(name: str) -> None:
    env, reply = REPLIES[name]
    spec, source = registry.get(env).spec, extract.program(reply)
    assert source is not None
    program = gate.check(source, spec)
    assert isinstance(program, gate.Program), [finding.sentence() for finding in program]
    try:
        traced = probe.probe(load.load(program), spec, states(env))
    except Refused as refusal:
        pytest.fail(refusal.finding.sentence())
    assert [finding.sentence() for finding in examine.examine(traced, spec, states(env))] == []


def test_the_honest_programs_are_a_hundred_together_with_those_of_test_honest() -> None:
    assert len(REPLIES) + len(PROGRAMS) >= 100
