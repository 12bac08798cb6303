"""The fork server: imports torch once, then runs each candidate in a confined child of its own.

Run by `sandbox.client` as a worker with an empty environment, so that no child inherits a secret. It reads nothing of
what a child writes beyond the length: the parent judges the bytes.
"""

from __future__ import annotations

import gc
import json
import os
import select
import signal
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

import torch

from ..reward import gate, graph, load, probe
from ..reward.states import only
from ..reward.trace import Refused
from ..types import Finding, StateSpec, StateVar
from ..worker import Channel, Frame
from .confine import confine

LENGTH = struct.Struct("<I")
MAX_ANSWER = 4 << 20
_WARM_UP = """
def compute_reward({arguments}):
    total = torch.zeros(num_envs)
    total[total > 1.0] += 1.0
    unit = normalize(torch.ones(num_envs, 4))
    spun = quat_mul(unit, quat_from_angle_axis(total, unit[:, :3]))
    total += torch.where(spun[:, 0] > 0, torch.exp(-torch.norm(spun, dim=-1)), torch.tensor(0.0)).clamp(0.0, 1.0)
    return total + {term}, {{"total": total}}
"""


@dataclass(frozen=True, slots=True)
class _Bench:
    """What every child works on."""

    spec: StateSpec
    recorded: Mapping[str, Any]
    confined: bool


@dataclass(frozen=True, slots=True)
class _Outcome:
    kind: str
    """`answer`, `timeout`, `crashed` or `oversized`."""
    answer: bytes = b""
    died_of: int = 0
    """Signal that ended the child, 0 for none. For the message only: how a process ends is never a verdict."""


def encode_spec(spec: StateSpec) -> list[list[Any]]:
    return [[v.name, list(v.shape), v.kind] for v in spec.variables]


def _decode_spec(data: list[Any]) -> StateSpec:
    return StateSpec(tuple(StateVar(name=n, meaning="", shape=tuple(shape), kind=kind) for n, shape, kind in data))


def _decode_recorded(frame: Frame) -> dict[str, Any]:
    recorded: dict[str, Any] = dict(frame.header["numbers"])
    for name, (shape, dtype) in frame.header["tensors"].items():
        flat = torch.frombuffer(bytearray(frame.blobs[name]), dtype=getattr(torch, dtype))
        recorded[name] = flat.reshape(shape)
    return recorded


def _probe_source(source: str, bench: _Bench, gated: bool) -> dict[str, Any]:
    """What one program comes to, as JSON data."""
    try:
        if gated:
            program = gate.check(source, bench.spec)
            if not isinstance(program, gate.Program):
                return {"findings": [_finding(finding) for finding in program]}
            run, recorded = load.load(program), only(bench.recorded, bench.spec, program.inputs)
        else:
            run, recorded = load.unchecked(source), bench.recorded
        traced = probe.probe(run, bench.spec, recorded)
    except Refused as refusal:
        return {"findings": [_finding(refusal.finding)]}
    return {"graph": graph.to_json(traced.graph), "lines": traced.lines}


def _finding(finding: Finding) -> list[Any]:
    return [finding.rule, finding.message, finding.fix, finding.line]


def _child(pipe: int, source: str, bench: _Bench, gated: bool) -> NoReturn:
    """Everything a child does; never returns."""
    try:
        os.setpgid(0, 0)
        null = os.open(os.devnull, os.O_RDWR)
        for descriptor in (0, 1, 2):
            os.dup2(null, descriptor)
        os.dup2(pipe, 3)
        os.closerange(4, 4096)
        try:
            confine(kernel=bench.confined)
        except OSError as error:
            _write(3, {"unconfined": str(error)})
        else:
            _write(3, _probe_source(source, bench, gated))
    except Exception as error:  # a fault of ours, or of a program without the gate: say which, then go
        _write(3, {"findings": [["error", f"the probe failed: {type(error).__name__}: {error}"[:400], "", None]]})
    finally:
        os._exit(0)


def _write(pipe: int, answer: Mapping[str, Any]) -> None:
    text = json.dumps(answer).encode()
    data = memoryview(LENGTH.pack(len(text)) + text)
    while data:
        data = data[os.write(pipe, data) :]


def _read_answer(pipe: int, deadline: float) -> tuple[str, bytes]:
    """`answer` and its bytes, or `timeout`, `crashed` or `oversized`."""
    received = bytearray()
    while True:
        left = deadline - time.monotonic()
        if left <= 0 or not select.select([pipe], [], [], left)[0]:
            return "timeout", b""
        chunk = os.read(pipe, 1 << 16)
        if not chunk:
            return "crashed", b""
        received += chunk
        if len(received) >= LENGTH.size:
            (size,) = LENGTH.unpack_from(received)
            if size > MAX_ANSWER:
                return "oversized", b""
            if len(received) >= LENGTH.size + size:
                return "answer", bytes(received[LENGTH.size : LENGTH.size + size])


def _kill(pid: int) -> int:
    """End a child and everything in its group; its wait status."""
    for send in (os.killpg, os.kill):
        try:
            send(pid, signal.SIGKILL)
        except (ProcessLookupError, PermissionError):
            pass
    return os.waitpid(pid, 0)[1]


def _run_child(source: str, bench: _Bench, *, gated: bool, seconds: float) -> _Outcome:
    """Probe one program in a child that is gone when this returns."""
    end, other = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(end)
        _child(other, source, bench, gated)
    os.close(other)
    try:
        os.setpgid(pid, pid)
    except (ProcessLookupError, PermissionError):
        pass
    kind, answer = _read_answer(end, time.monotonic() + seconds)
    if kind == "crashed":
        time.sleep(0.01)  # the pipe closes a moment before the process is gone: let it tell its signal
    ended, status = os.waitpid(pid, os.WNOHANG)
    if not ended:
        status = _kill(pid)
    os.close(end)
    return _Outcome(kind, answer, os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0)


def main() -> None:
    channel = Channel()
    torch.set_num_threads(1)  # a child is forked: it must need no thread that only its parent has
    frame = channel.receive()
    if frame is None:
        return
    bench = _Bench(_decode_spec(frame.header["spec"]), _decode_recorded(frame), frame.header["confined"])
    problem = _warm_up(bench)
    channel.send({"problem": problem})
    while not problem and (frame := channel.receive()) is not None:
        request = frame.header
        outcome = _run_child(request["source"], bench, gated=request["gated"], seconds=request["seconds"])
        channel.send({"outcome": outcome.kind, "signal": outcome.died_of}, {"answer": outcome.answer})


def _warm_up(bench: _Bench) -> str:
    """Load what torch loads lazily, before a child may open no file, and try one child; the problem met, or nothing."""
    variable = next(v for v in bench.spec.variables if v.kind == "world")
    term = f"{variable.name}.reshape(num_envs, -1).sum(dim=-1)"
    source = _WARM_UP.format(arguments=variable.name, term=term)
    _probe_source(source, bench, gated=True)
    gc.collect()
    gc.freeze()  # children then share these pages instead of copying them
    outcome = _run_child(source, bench, gated=True, seconds=60.0)
    answer = json.loads(outcome.answer) if outcome.kind == "answer" else {}
    return "" if "graph" in answer else f"{outcome.kind} {outcome.died_of} {json.dumps(answer)[:300]}"


if __name__ == "__main__":
    main()
