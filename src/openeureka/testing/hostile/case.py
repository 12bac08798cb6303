"""What a hostile program is, and the state table that all of them read."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from ...types import StateSpec, StateVar, VerdictCode

STATE = StateSpec(
    (
        StateVar("pos", "position [m]", (3,)),
        StateVar("vel", "velocity [m/s]", (3,)),
        StateVar("phase", "phase of a gait [rad]"),
        StateVar("dt", "time step [s]", kind="float"),
        StateVar("num_envs", "number of worlds", kind="num_envs"),
    )
)


class Layer(StrEnum):
    """What stops a program, or makes it harmless."""

    GATE = "gate"  # reads it and never runs it
    KERNEL = "kernel"  # ends its process, or refuses it memory and time
    PROBE = "probe"  # runs it in its process and holds it to the contract
    GRAPH = "graph"  # keeps only its arithmetic, in which nothing harmful is left: accepted
    TRAINING = "training"  # accepted on recorded states; its lane is stopped when it misbehaves on others


@dataclass(frozen=True, slots=True)
class Hostile:
    """One program and what must become of it. `CANARY` in a source stands for a file that must stay as it is."""

    number: int
    """Number of the idea behind it. Several programs may be forms of one idea."""
    name: str
    source: str
    layer: Layer
    code: VerdictCode
    rule: str = ""
    """Rule of the first finding; empty for an accepted program."""

    @property
    def id(self) -> str:
        return f"{self.number:02d}-{self.name}"


def function(body: str) -> str:
    """A reward whose middle part is `body`, from line 3 on."""
    lines = "\n".join(f"    {line}" for line in body.split("\n"))
    return f"def compute_reward(pos, vel, dt):\n    r = -pos.norm(dim=-1)\n{lines}\n    return r, {{'r': r}}\n"


def gate(number: int, name: str, rule: str, body: str) -> Hostile:
    return gate_text(number, name, rule, function(body))


def gate_text(number: int, name: str, rule: str, source: str) -> Hostile:
    return Hostile(number, name, source, Layer.GATE, VerdictCode.REFUSED, rule)


def probe(number: int, name: str, rule: str, body: str) -> Hostile:
    return probe_text(number, name, rule, function(body))


def probe_text(number: int, name: str, rule: str, source: str) -> Hostile:
    return Hostile(number, name, source, Layer.PROBE, VerdictCode.CONTRACT, rule)


def returns(number: int, name: str, rule: str, value: str) -> Hostile:
    source = f"def compute_reward(pos, vel):\n    r = -pos.norm(dim=-1)\n    return {value}\n"
    return probe_text(number, name, rule, source)


def out_of_memory(number: int, name: str, body: str) -> Hostile:
    return Hostile(number, name, function(body), Layer.KERNEL, VerdictCode.CONTRACT, "error")


def out_of_time(number: int, name: str, body: str) -> Hostile:
    return Hostile(number, name, function(body), Layer.KERNEL, VerdictCode.TIMEOUT, "timeout")


def harmless(number: int, name: str, body: str) -> Hostile:
    return Hostile(number, name, function(body), Layer.GRAPH, VerdictCode.ACCEPTED)


def later(number: int, name: str, body: str) -> Hostile:
    """Well-behaved on recorded states: `pos`, `vel` and `phase` below 8, `phase` 0 in some worlds."""
    source = function(body).replace("dt)", "phase, dt)")
    return Hostile(number, name, source, Layer.TRAINING, VerdictCode.ACCEPTED)
