"""Runs each candidate in a confined child, and judges its graph in another: a fork server, which imports torch once.

The first child runs the program and traces it. The program may have taken over that process, so its answer is not
trusted: the second child, which runs nothing but the graph, reads and judges it. If either dies, that is a verdict.

`sandbox.client` runs the server as a worker with an almost empty environment, so that no child inherits a secret. The
server reads only the length of what a child writes: the bytes are for the second child and for the client.
"""

from __future__ import annotations

import ctypes
import gc
import os
import select
import signal
import struct
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn

import torch

from ..codec import convert, encode
from ..reward import examine, gate, graph, load, probe
from ..reward.dispatch import without_compiler
from ..reward.states import only
from ..reward.trace import Refused
from ..reward.validate import GraphError, validate
from ..types import Finding, StateSpec
from ..worker import Channel, Frame
from .answer import Answer
from .confine import confine

LENGTH = struct.Struct("<I")
MAX_FINDINGS = 20
PATIENCE = 4
"""Seconds on the clock for each second of processor time that a child may use: a busy machine is not its fault."""
TRIES = (PATIENCE, 4 * PATIENCE)
"""Patience with a child, and with a second one for the same program if the clock ended the first."""
LAST_TRY = 16 * PATIENCE
"""Patience on a busy machine: enough for a program that loops for ever to use up its processor time."""
LONGEST = 2 * (sum(TRIES) + LAST_TRY) + TRIES[-1]
"""Patience with both children in all tries, and with the child that shows whether the machine is busy."""
MAX_ANSWER = 4 << 20
_HUGE, _MADV_HUGEPAGE, _MADV_COLLAPSE = 2 << 20, 14, 25
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
    worlds: int
    confined: bool


@dataclass(frozen=True, slots=True)
class _Outcome:
    kind: str
    """`answer`, `timeout` (processor time used up), `waited` (ended by the clock with processor time left), `busy`
    (waited, as did a child that only computes), `crashed` or `oversized`."""
    answer: bytes = b""
    died_of: int = 0
    """Signal that ended the child, 0 for none. For the message only: how a process ends is never a verdict."""


def _decode_recorded(frame: Frame) -> dict[str, Any]:
    recorded: dict[str, Any] = dict(frame.header["numbers"])
    for name, (shape, dtype) in frame.header["tensors"].items():
        flat = torch.frombuffer(bytearray(frame.blobs[name]), dtype=getattr(torch, dtype))
        recorded[name] = flat.reshape(shape)
    return recorded


def _gate(source: str, bench: _Bench) -> gate.Program | Answer:
    """The program behind a text, or why it is refused. Runs nothing."""
    program = gate.check(source, bench.spec)
    return program if isinstance(program, gate.Program) else Answer(findings=_findings(program))


def _probe(program: gate.Program, bench: _Bench) -> Answer:
    """The graph of a program, or why it is refused."""
    recorded = only(bench.recorded, bench.spec, program.inputs)
    try:
        traced = probe.probe(load.load(program), bench.spec, recorded, bench.worlds)
    except Refused as refusal:
        return Answer(findings=_findings([_twinned(refusal.finding, program)], program.return_line))
    return Answer(graph=traced.graph, lines=tuple(traced.lines), returns=program.return_line)


def _twinned(finding: Finding, program: gate.Program) -> Finding:
    """The finding; if a function of numpy or math was given a tensor, it names the function of torch to use."""
    if finding.rule != "branch" or not (found := gate.of_numbers(program, finding.line)):
        return finding
    name, known = found
    return replace(finding, message=f"`{name}` takes numbers and this is a tensor", fix=f"use `{known}`")


def _examine(text: bytes, bench: _Bench) -> Answer:
    """The verdict on what a child answered: findings, or a graph that may train, or neither."""
    said = Answer.read(text)
    if said.findings or said.graph is None:
        return Answer(findings=said.findings)
    try:
        validate(said.graph)
    except GraphError as error:
        return _refusal("operation", f"its graph is not allowed: {error}"[:300])
    parsed, origin = graph.simplify(said.graph)
    lines = tuple(said.lines[index] if index < len(said.lines) else None for index in origin)
    found = examine.examine(probe.Traced(parsed, lines), bench.spec, bench.recorded, bench.worlds)
    return Answer(findings=_findings(found, said.returns)) if found else Answer(graph=parsed)


def _refusal(rule: str, message: str) -> Answer:
    return Answer(findings=(Finding(rule=rule, message=message),))


def _findings(findings: Sequence[Finding], returns: int | None = None) -> tuple[Finding, ...]:
    """The first `MAX_FINDINGS`; one about the result as a whole names the line that returns it."""
    whole = probe.RESULT_RULES
    return tuple(
        replace(finding, line=returns) if finding.line is None and finding.rule in whole else finding
        for finding in findings[:MAX_FINDINGS]
    )


class _Allowance:
    """Processor time that a child may use. Time on the clock counts too, divided by the patience, so that no child
    waits for ever.

    If the kernel does not tell the processor time of a process, time on the clock counts in full.
    """

    def __init__(self, pid: int, seconds: float, patience: int) -> None:
        self._pid, self._seconds, self._patience, self._started = pid, seconds, patience, time.monotonic()

    def left(self) -> float:
        """Seconds left, 0 or less when it is used up."""
        passed = time.monotonic() - self._started
        used = self._used()
        return self._seconds - (passed if used is None else max(used, passed / self._patience))

    def waited(self) -> bool:
        """Whether processor time is left. If so, the child mostly waited, which says nothing about its program."""
        used = self._used()
        return used is not None and used < self._seconds

    def _used(self) -> float | None:
        """Processor time in seconds, if the kernel tells."""
        try:
            fields = Path(f"/proc/{self._pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            return None
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class _Child:
    """A confined process that answers once.

    Args:
        work: what it does, once confined; it may read its standard input to the end.
    """

    def __init__(self, work: Callable[[], Answer], *, confined: bool) -> None:
        request, self._request = os.pipe()
        self._answer, answer = os.pipe()
        self._pid = os.fork()
        if self._pid == 0:
            _serve(request, answer, work, confined)
        os.close(request)
        os.close(answer)
        with suppress(ProcessLookupError, PermissionError):
            os.setpgid(self._pid, self._pid)

    def finish(self, seconds: float, request: bytes = b"", patience: int = PATIENCE) -> _Outcome:
        """Hand over its input and wait for its answer; the process is gone when this returns."""
        kind, answer = self._exchange(request, _Allowance(self._pid, seconds, patience))
        if kind == "crashed":
            time.sleep(0.01)  # the pipe closes just before the process ends: wait for its signal
        return _Outcome(kind, answer, self.end())

    def _exchange(self, request: bytes, allowance: _Allowance) -> tuple[str, bytes]:
        """The kind of outcome, as in `_Outcome`, and the bytes of an answer."""
        os.set_blocking(self._request, False)  # a child that does not read would hold up a write for ever
        unsent, received = memoryview(request), bytearray()
        while True:
            if self._request >= 0 and not unsent:
                os.close(self._request)
                self._request = -1
            if (left := allowance.left()) <= 0:
                return "waited" if allowance.waited() else "timeout", b""
            readable, writable, _ = select.select([self._answer], [self._request] if unsent else [], [], left)
            if writable:
                try:
                    unsent = unsent[os.write(self._request, unsent) :]
                except BrokenPipeError:
                    unsent = unsent[:0]  # it reads no more, but it may have answered: what it wrote decides
            if not readable:
                continue
            chunk = os.read(self._answer, 1 << 16)
            if not chunk:
                return "crashed", b""
            received += chunk
            if len(received) >= LENGTH.size:
                (size,) = LENGTH.unpack_from(received)
                if size > MAX_ANSWER:
                    return "oversized", b""
                if len(received) >= LENGTH.size + size:
                    return "answer", bytes(received[LENGTH.size : LENGTH.size + size])

    def end(self) -> int:
        """End the child and everything in its group. Returns the signal that ended it, 0 for none."""
        for descriptor in (self._request, self._answer):
            if descriptor >= 0:
                os.close(descriptor)
        ended, status = os.waitpid(self._pid, os.WNOHANG)
        if not ended:
            for send in (os.killpg, os.kill):
                with suppress(ProcessLookupError, PermissionError):
                    send(self._pid, signal.SIGKILL)
            _, status = os.waitpid(self._pid, 0)
        return os.WTERMSIG(status) if os.WIFSIGNALED(status) else 0


def _serve(request: int, answer: int, work: Callable[[], Answer], confined: bool) -> NoReturn:
    """Everything a child does; never returns."""
    try:
        os.setpgid(0, 0)
        null = os.open(os.devnull, os.O_RDWR)
        for descriptor, end in ((0, request), (1, null), (2, null), (3, answer)):
            os.dup2(end, descriptor)
        os.closerange(4, 4096)
        try:
            confine(kernel=confined)
        except OSError as error:
            _answer(_refusal("unconfined", f"its process cannot be confined: {error.strerror or error}"))
        else:
            _answer(work())
    except Exception as error:  # a fault of ours, or of a program that slipped through the gate: say which, then go
        _answer(_refusal("error", f"the probe failed: {type(error).__name__}: {error}"[:400]))
    finally:
        os._exit(0)


def _answer(answer: Answer) -> None:
    text = encode(answer).encode()
    left = memoryview(LENGTH.pack(len(text)) + text)
    while left:
        left = left[os.write(3, left) :]


def _input() -> bytes:
    """All of a child's standard input."""
    received = bytearray()
    while chunk := os.read(0, 1 << 20):
        received += chunk
    return bytes(received)


def _judge(program: gate.Program, bench: _Bench, seconds: float) -> tuple[str, _Outcome]:
    """The child that decided, `program` or `graph`, and the outcome.

    About one child in a thousand waits for ever without computing, whatever program it is given, and a busy machine may
    keep a child waiting as long. So a program whose child waited is tried once more, with more time. If that child
    waits too, a child that only computes shows whether the program or the machine is at fault. On a busy machine the
    program gets a last try, long enough for an endless loop to use up its processor time.
    """
    first, longer = TRIES
    where, outcome = _judge_once(program, bench, seconds, first)
    if outcome.kind == "waited":
        where, outcome = _judge_once(program, bench, seconds, longer)
    if outcome.kind == "waited" and _Child(_compute, confined=False).finish(seconds, patience=longer).kind == "waited":
        where, outcome = _judge_once(program, bench, seconds, LAST_TRY)
        if outcome.kind == "waited":
            outcome = replace(outcome, kind="busy")
    return where, outcome


def _compute() -> NoReturn:
    """Use the processor for ever."""
    while True:
        pass


def _judge_once(program: gate.Program, bench: _Bench, seconds: float, patience: int) -> tuple[str, _Outcome]:
    first = _Child(lambda: _probe(program, bench), confined=bench.confined)
    # Made before the first finishes, so that on a second core it is confined when it is needed.
    second = _Child(lambda: _examine(_input(), bench), confined=bench.confined)
    outcome = first.finish(seconds, patience=patience)
    if outcome.kind != "answer":
        second.end()
        return "program", outcome
    return "graph", second.finish(seconds, outcome.answer, patience)


def main() -> None:
    channel = Channel()
    torch.set_num_threads(1)  # a child is forked: it must need no thread that only its parent has
    without_compiler()  # every child would inherit it
    frame = channel.receive()
    if frame is None:
        return
    header = frame.header
    bench = _Bench(convert(StateSpec, header["spec"]), _decode_recorded(frame), header["worlds"], header["confined"])
    problem = _warm_up(bench)
    channel.send({"problem": problem})
    while not problem and (frame := channel.receive()) is not None:
        request = frame.header
        program = _gate(request["source"], bench)
        if isinstance(program, Answer):
            channel.send({"outcome": "refused"}, {"answer": encode(program).encode()})
            continue
        where, outcome = _judge(program, bench, request["seconds"])
        header = {"outcome": outcome.kind, "where": where, "signal": outcome.died_of}
        channel.send(header, {"answer": outcome.answer})


def _warm_up(bench: _Bench) -> str:
    """Load what torch loads lazily, since a confined child can open no file, then judge a sample program. Returns the
    problem, or an empty text."""
    name = bench.spec.per_world[0]
    term = f"{name}.reshape(num_envs, -1).sum(dim=-1)"
    program = _gate(_WARM_UP.format(arguments=name, term=term), bench)
    assert isinstance(program, gate.Program), program
    _examine(encode(_probe(program, bench)).encode(), bench)
    gc.collect()
    gc.freeze()  # children then share these pages instead of copying them
    _collapse()
    _, outcome = _judge(program, bench, 60.0)
    answer = Answer.read(outcome.answer)
    if outcome.kind == "answer" and answer.graph is not None:
        return ""
    return answer.findings[0].message if answer.findings else f"{outcome.kind}, signal {outcome.died_of}"


def _collapse() -> None:
    """Gather this process's memory in huge pages: for 200 MB in small ones, a fork copies 50,000 page table entries.

    Where the kernel cannot (before Linux 6.1) forks take a few milliseconds more.
    """
    libc = ctypes.CDLL(None)
    for line in Path("/proc/self/maps").read_text().splitlines() if sys.platform == "linux" else ():
        addresses, rights, *_, name = (*line.split(maxsplit=5), "")[:6]
        begin, end = (int(address, 16) // _HUGE * _HUGE for address in addresses.split("-"))
        if rights == "rw-p" and name.strip() in ("", "[heap]") and end - begin > _HUGE:
            for advice in (_MADV_HUGEPAGE, _MADV_COLLAPSE):
                libc.madvise(ctypes.c_void_p(begin + _HUGE), ctypes.c_size_t(end - begin - _HUGE), advice)


if __name__ == "__main__":
    main()
