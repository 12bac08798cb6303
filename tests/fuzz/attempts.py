"""The outcome of one odd or damaged graph, reply, program or call; any exception that is not caught here is a bug."""

from __future__ import annotations

from functools import cache
from random import Random

import torch

from openeureka.codec import DecodeError, decode, encode
from openeureka.reward import examine, extract, gate, load, probe
from openeureka.reward import graph as graphs
from openeureka.reward.trace import Refused
from openeureka.reward.validate import GraphError, validate
from openeureka.testing.hostile import STATE
from openeureka.types import RewardGraph

from . import mutate, odd

_REWARDS = (
    "r = torch.exp(-pos.norm(dim=-1) / 0.1)\n    r[phase > 0.5] += 1.0",
    "r = (pos * torch.tensor([1.0, 0.5, 0.25])).sum(dim=-1) + torch.max(vel, dim=-1).values.clamp(-1.0, 2.0)",
    "a, b = torch.sort(pos, dim=-1)[0][:, :2].unbind(-1)\n    r = torch.where(a > b, a, torch.zeros(num_envs))",
    "r = torch.stack([pos[:, i] * vel[:, i] for i in range(3)], dim=-1).reshape(num_envs, 3).mean(dim=-1)",
    "i = phase.abs().long().clamp(0, 2)\n    r = pos.gather(1, i.unsqueeze(-1)).squeeze(-1) + torch.arange(3.0)[i]",
)
"""Together they have reductions, masks, constants, several results, sizes from the number of worlds, and indices."""
_PROGRAM = '''def compute_reward(pos, vel, phase, dt, num_envs):
    """Reward nearness."""
    {body}
    return r, {{"r": r, "speed": vel.norm(dim=-1) * dt}}
'''
_REPLY = "Let me think.\n\n```python\nimport torch\nfrom typing import Dict\n\n{program}```\nIt pays for *r*.\n"
_WORLDS = 12
_TRAINED = 300
"""Worlds of a training: more than there are recorded states, as in a run."""


@cache
def _states() -> dict[str, torch.Tensor | float]:
    generator = torch.Generator().manual_seed(0)
    shapes = {"pos": (_WORLDS, 3), "vel": (_WORLDS, 3), "phase": (_WORLDS,)}
    return {**{name: torch.randn(shape, generator=generator) for name, shape in shapes.items()}, "dt": 0.02}


@cache
def good_graphs() -> tuple[str, ...]:
    """Graphs of good programs, as they are stored."""
    found: list[str] = []
    for body in _REWARDS:
        program = gate.check(_PROGRAM.format(body=body), STATE)
        assert isinstance(program, gate.Program), program
        found.append(encode(probe.probe(load.load(program), STATE, _states()).graph))
    return tuple(found)


def _read(text: str) -> RewardGraph:
    """Raises DecodeError or GraphError."""
    found = decode(RewardGraph, text)
    validate(found)
    return found


def graph(random: Random) -> str:
    """`refused` as text, `finding` on states, or `accepted`: then it must run and give finite values."""
    text = mutate.graph(random.choice(good_graphs()), random)
    try:
        parsed = _read(text)
    except (DecodeError, GraphError):
        return "refused"
    if examine.examine(probe.Traced(parsed, ()), STATE, _states(), _TRAINED):
        return "finding"
    reward, components = graphs.CompiledReward(parsed, STATE)(_states(), _WORLDS)
    assert all(value.shape == (_WORLDS,) and value.isfinite().all() for value in (reward, *components.values())), text
    return "accepted"


def reply(random: Random) -> str:
    """`no program`, `refused` by the gate with a sentence a person can read, or `program`."""
    whole = _REPLY.format(program=_PROGRAM.format(body=random.choice(_REWARDS)))
    source = extract.program(mutate.reply(whole, random))
    if source is None:
        return "no program"
    checked = gate.check(source, STATE)
    if isinstance(checked, gate.Program):
        return "program"
    for finding in checked:
        assert finding.sentence().isprintable() and len(finding.sentence()) < 1000, finding
    return "refused"


def program(random: Random) -> str:
    """`refused` by the gate, `finding` of the probe or on the graph, or `accepted`."""
    checked = gate.check(odd.program(random), STATE)
    if not isinstance(checked, gate.Program):
        assert all(finding.rule != "unreadable" for finding in checked), checked
        return "refused"
    try:
        traced = probe.probe(load.load(checked), STATE, {**_states(), "num_envs": _WORLDS})
    except Refused:
        return "finding"
    return "finding" if examine.examine(traced, STATE, _states(), _TRAINED) else "accepted"


def call(random: Random) -> str:
    """`refused` as a graph, `raised` an error from which a verdict is made, or `ran`."""
    made = odd.call(random)
    try:
        list(graphs.values(_read(encode(made)), _states(), _WORLDS))
    except (DecodeError, GraphError):
        return "refused"
    except (RuntimeError, IndexError, ValueError, TypeError, NotImplementedError, ZeroDivisionError, OverflowError):
        return "raised"
    return "ran"
