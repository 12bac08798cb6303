"""Ordinary replies of language models for the real tasks: each becomes a graph that may train."""

from __future__ import annotations

import functools
from pathlib import Path

import pytest
import torch

from openeureka.reward import examine, extract, gate, graph, load, probe
from openeureka.reward.states import Recorded, take
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


@pytest.mark.parametrize(
    "held",
    [
        "root_state_tensor[object_indices, 0:7]",
        "root_state_tensor[object_indices][:, 0:7]",
        "root_state_tensor[object_indices.long(), :7]",
        "root_state_tensor[object_indices.to(torch.long)][..., :7]",
        "root_state_tensor[:, object_indices, :7]",
        "root_state_tensor.view(num_envs, -1, 13)[:, object_indices, :7]",
    ],
)
def test_rows_of_actors_are_taken_as_in_the_original(held: str) -> None:
    spec = registry.get("allegro_hand").spec
    arguments = "root_state_tensor, object_indices, num_envs: int"
    program = gate.check(f"def f({arguments}):\n    return {held}.sum(-1), {{}}\n", spec)
    assert isinstance(program, gate.Program), [finding.sentence() for finding in program]
    traced = probe.probe(load.load(program), spec, states("allegro_hand"))
    moments = take(states("allegro_hand"), spec, range(8))
    reward, _ = graph.CompiledReward(traced.graph, spec)(moments)
    torch.testing.assert_close(reward, moments["object_pose"].sum(-1))


def test_the_honest_programs_are_a_hundred_together_with_those_of_test_honest() -> None:
    assert len(REPLIES) + len(PROGRAMS) >= 100
