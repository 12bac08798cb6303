"""Checks candidates: the gate here, the probe in a confined child, the resulting graph again here."""

from __future__ import annotations

import json
import re
import signal
import time
import unicodedata
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from torch import Tensor

from ..errors import SandboxUnavailable, WorkerError
from ..reward import examine, gate, graph, probe
from ..types import Candidate, Finding, Node, RewardGraph, StateSpec, Verdict, VerdictCode
from ..worker import Frame, Worker, WorkerDied, WorkerTimeout
from . import confine, server

SECONDS = 2.0
"""A candidate's time, by the wall clock, for everything it does in its child."""
_START_SECONDS = 120.0
_GRACE_SECONDS = 5.0
_MAX_FINDINGS = 20
_RULE = re.compile(r"[a-z][a-z-]{0,31}")
_Judgement = tuple[VerdictCode, tuple[Finding, ...], RewardGraph | None]


class Sandbox:
    """Judges candidates on recorded states of one task. A context manager; one candidate at a time.

    Args:
        state: the task's table.
        recorded: real states, reset states among them: per-world variables (M, *shape), M about 256; others as is.
        unsafe: probe in a child that only limits bound, where the kernel cannot confine it.

    Raises:
        SandboxUnavailable: on entry, where the kernel lacks Landlock or seccomp and `unsafe` is false.
    """

    def __init__(self, state: StateSpec, recorded: Mapping[str, Tensor | float | int], *, unsafe: bool = False) -> None:
        missing = [v.name for v in state.variables if v.name not in recorded and v.kind != "num_envs"]
        if missing:
            raise ValueError(f"no recorded states for {missing}")
        self.state = state
        self._tensors = {n: v.detach().cpu().contiguous() for n, v in recorded.items() if isinstance(v, Tensor)}
        self.recorded = {**recorded, **self._tensors}
        self._confined = not unsafe
        self._worker: Worker | None = None
        self._gated = True  # tests of confinement switch the gate off

    def __enter__(self) -> Sandbox:
        if self._confined and not (offered := confine.support()).complete:
            raise SandboxUnavailable(
                f"{offered.sentence()}; add unsafe_no_sandbox=true to run it with your rights all the same."
            )
        self._start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the server and any child; safe to call twice."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None

    def check(self, candidate: Candidate) -> Verdict:
        """The verdict on one candidate; never raises for anything the candidate does.

        Raises:
            WorkerError: when the server itself cannot be started.
        """
        started = time.monotonic()
        code, findings, accepted = self._judge(candidate.source)
        seconds = time.monotonic() - started
        return Verdict(candidate=candidate.id, code=code, findings=findings, graph=accepted, seconds=seconds)

    def _judge(self, source: str) -> _Judgement:
        if not self._gated:
            return self._run(source)
        program = gate.check(source, self.state)
        if not isinstance(program, gate.Program):
            code = VerdictCode.NO_PROGRAM if program[0].rule == "no-function" else VerdictCode.REFUSED
            return code, program, None
        code, findings, accepted = self._run(source)
        return code, tuple(_located(finding, program) for finding in findings), accepted

    def _run(self, source: str) -> _Judgement:
        frame = self._ask(source)
        outcome = frame.header.get("outcome") if frame is not None else "timeout"
        if frame is None or outcome == "timeout":
            message = f"the program ran for more than {SECONDS:g} s on a few hundred states"
            finding = Finding(rule="timeout", message=message, fix="use tensor operations instead of Python loops")
            return VerdictCode.TIMEOUT, (finding,), None
        answer = _parse(frame.blobs.get("answer", b"")) if outcome == "answer" else None
        if answer is None:
            return VerdictCode.CRASHED, (_crash(frame.header.get("signal")),), None
        if "findings" in answer:
            return VerdictCode.CONTRACT, _read_findings(answer["findings"]), None
        return self._examine(answer)

    def _examine(self, answer: Mapping[str, Any]) -> _Judgement:
        try:
            parsed = graph.from_json(answer["graph"])
        except (graph.GraphError, KeyError, TypeError) as error:
            finding = Finding(rule="operation", message=f"its graph is not allowed: {str(error)[:200]}")
            return VerdictCode.CONTRACT, (finding,), None
        lines = answer.get("lines")
        known = lines if isinstance(lines, list) and all(type(n) is int or n is None for n in lines) else []
        findings = examine.examine(probe.Traced(parsed, tuple(known)), self.state, self.recorded)
        if findings:
            return VerdictCode.CONTRACT, findings, None
        return VerdictCode.ACCEPTED, (), parsed

    # --- the server ---

    def _start(self) -> Worker:
        tensors = self._tensors
        worker = Worker("openeureka.sandbox.server", env={}, max_blobs=2 * server.MAX_ANSWER)
        header = {
            "spec": server.encode_spec(self.state),
            "numbers": {name: value for name, value in self.recorded.items() if name not in tensors},
            "tensors": {n: [list(t.shape), str(t.dtype).removeprefix("torch.")] for n, t in tensors.items()},
            "confined": self._confined,
        }
        try:
            worker.send(header, {name: _bytes(tensor) for name, tensor in tensors.items()})
            self._warm_up()  # while the server does the same
            problem = worker.receive(_START_SECONDS).header.get("problem")
        except WorkerError:
            tail = worker.stderr_tail(500)
            worker.close()
            raise WorkerError(f"The sandbox server did not start: {tail or 'no message'}") from None
        if problem:
            worker.close()
            raise SandboxUnavailable(f"The sandbox cannot run a program it knows to be good: {problem}")
        self._worker = worker
        return worker

    def _warm_up(self) -> None:
        """Load here what torch loads lazily, so that the first candidate is not judged slow."""
        variable = next(v for v in self.state.variables if v.kind == "world")
        square = Node("mul.Tensor", ({"ref": 0}, {"ref": 0}))
        total = Node("sum.dim_IntList", ({"ref": 1}, tuple(range(1, len(variable.shape) + 1))))
        nodes = (Node("input", (variable.name,)), square, *((total,) if variable.shape else ()))
        small = RewardGraph(nodes=nodes, reward=len(nodes) - 1, components=())
        examine.examine(probe.Traced(small, ()), self.state, self.recorded)

    def _ask(self, source: str) -> Frame | None:
        """The server's frame; None when it hung. A server that died is started again, once."""
        for attempt in (1, 2):
            worker = self._worker or self._start()
            try:
                worker.send({"source": source, "gated": self._gated, "seconds": SECONDS})
                return worker.receive(SECONDS + _GRACE_SECONDS)
            except WorkerTimeout:
                self.close()
                return None
            except WorkerDied:
                self.close()
                if attempt == 2:
                    return Frame({"outcome": "crashed"})
        return None


def _bytes(tensor: Tensor) -> bytes:
    return tensor.numpy().tobytes()


def _located(finding: Finding, program: gate.Program) -> Finding:
    """A finding about the result as a whole names the line that returns it; one about numbers, what reads them."""
    if finding.rule == "branch" and (found := gate.twins(program, finding.line)):
        (name, known), *_ = found.items()
        return replace(finding, message=f"`{name}` takes numbers and this is a tensor", fix=f"use `{known}`")
    whole = finding.line is None and finding.rule in probe.RESULT_RULES
    return replace(finding, line=program.return_line) if whole else finding


def _parse(data: bytes) -> dict[str, Any] | None:
    try:
        answer = json.loads(data)
    except (ValueError, RecursionError):
        return None
    return answer if isinstance(answer, dict) else None


def _crash(number: object) -> Finding:
    if number == signal.SIGSYS:
        return Finding(rule="system-call", message="the program tried to start a process or open a connection")
    name = signal.Signals(number).name if isinstance(number, int) and number in set(signal.Signals) else "no answer"
    return Finding(rule="crash", message=f"the program ended its process ({name})", fix="use plain tensor operations")


def _read_findings(data: object) -> tuple[Finding, ...]:
    """Findings from a child, which may hold any text."""
    findings: list[Finding] = []
    for item in data[:_MAX_FINDINGS] if isinstance(data, list) else []:
        if not (isinstance(item, list) and len(item) == 4):
            continue
        rule, message, fix, line = item
        known = rule if isinstance(rule, str) and _RULE.fullmatch(rule) else "error"
        number = line if type(line) is int and 0 < line < 100_000 else None
        findings.append(Finding(rule=known, message=_clean(message), fix=_clean(fix), line=number))
    return tuple(findings) or (Finding(rule="crash", message="the program sent an answer of the wrong form"),)


def _clean(text: object) -> str:
    """One printable line of at most 500 characters."""
    shown = str(text)[:2000]
    return "".join(c if unicodedata.category(c)[0] != "C" else " " for c in shown).strip()[:500]
