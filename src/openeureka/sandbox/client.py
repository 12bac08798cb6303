"""Checks candidates, the program in one confined child and its graph in another; reads their answers as data."""

from __future__ import annotations

import os
import re
import signal
import time

from torch import Tensor

from ..errors import SandboxUnavailable, WorkerError
from ..reward.states import Recorded
from ..reward.validate import GraphError, validate
from ..text import printable
from ..types import Candidate, Finding, RewardGraph, StateSpec, Verdict, VerdictCode
from ..worker import Frame, Worker, WorkerTimeout
from . import confine, server
from .answer import Answer

SECONDS = 2.0
"""Processor time of each of a candidate's two children, that for the program and that for its graph."""
_START_SECONDS = 120.0
_GRACE_SECONDS = 5.0
_MAX_LINE = 100_000
_MAX_FIX = 2_000
"""Characters: a fix may list every state variable."""
_OUTCOMES = {
    "timeout": (
        VerdictCode.TIMEOUT,
        "timeout",
        "{what} ran for more than {seconds:g} s on a few hundred states",
        "use tensor operations instead of Python loops",
    ),
    "waited": (
        VerdictCode.TIMEOUT,
        "timeout",
        "{what} did nothing for most of {longest:g} s, on a machine with processors to spare",
        "use plain tensor operations",
    ),
    "silent": (
        VerdictCode.TIMEOUT,
        "timeout",
        "nothing was heard of it again, twice",
        "write a shorter program of plain tensor operations",
    ),
    "oversized": (
        VerdictCode.CONTRACT,
        "memory",
        "its graph holds too many numbers",
        "compute tables with torch operations, from a few numbers",
    ),
}
"""For each outcome without an answer: the verdict, the rule, the message and the fix."""
_RULE = re.compile(r"[a-z][a-z-]{0,31}")
_Judgement = tuple[VerdictCode, tuple[Finding, ...], RewardGraph | None]


class Sandbox:
    """Judges candidates on recorded states of one task. A context manager; one candidate at a time.

    Args:
        state: the task's table.
        recorded: real states, including reset states: per-world variables (M, *shape), M about 256; others as is.
        worlds: per lane in the training that follows, 0 if there is none: graphs are measured with as many.
        unsafe: do without Landlock and seccomp, so that only limits bound the children.

    Raises:
        SandboxUnavailable: on entry, where the kernel lacks Landlock or seccomp and `unsafe` is false.
    """

    def __init__(self, state: StateSpec, recorded: Recorded, *, worlds: int = 0, unsafe: bool = False) -> None:
        missing = [v.name for v in state.variables if v.name not in recorded and v.kind != "num_envs"]
        if missing:
            raise ValueError(f"no recorded states for {missing}")
        self.state = state
        self._tensors = {n: v.detach().cpu().contiguous() for n, v in recorded.items() if isinstance(v, Tensor)}
        self.recorded = {**recorded, **self._tensors}
        self._worlds = worlds
        self._confined = not unsafe
        self._worker: Worker | None = None

    def __enter__(self) -> Sandbox:
        if self._confined and not (offered := confine.support()).complete:
            raise SandboxUnavailable(
                f"{offered.sentence()}; add unsafe_no_sandbox=true to run it anyway, with all of your rights."
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
            SandboxUnavailable: when the machine is too busy to judge anything.
            WorkerError: when the server itself cannot be started.
        """
        started = time.monotonic()
        code, findings, accepted = self._judge(candidate.source)
        seconds = time.monotonic() - started
        return Verdict(candidate=candidate.id, code=code, findings=findings, graph=accepted, seconds=seconds)

    def _judge(self, source: str) -> _Judgement:
        frame = self._ask(source)
        outcome = frame.header.get("outcome")
        what = "its graph" if frame.header.get("where") == "graph" else "the program"
        longest = SECONDS * server.TRIES[-1]
        if outcome == "busy":
            raise SandboxUnavailable(
                f"The machine is too busy to judge a reward: no process gets {SECONDS:g} s of processor time in "
                f"{longest:g} s; stop other programs, then try again."
            )
        if outcome in _OUTCOMES:
            code, rule, message, fix = _OUTCOMES[outcome]
            message = message.format(what=what, seconds=SECONDS, longest=longest)
            return code, (Finding(rule=rule, message=message, fix=fix),), None
        answer = Answer.read(frame.blobs.get("answer", b""))
        if outcome not in ("answer", "refused"):
            return VerdictCode.CRASHED, (_crash(frame.header.get("signal"), what),), None
        if answer.findings:
            findings = tuple(map(_cleaned, answer.findings[: server.MAX_FINDINGS]))
            if outcome == "answer":
                return VerdictCode.CONTRACT, findings, None
            code = VerdictCode.NO_PROGRAM if findings[0].rule == "no-function" else VerdictCode.REFUSED
            return code, findings, None
        if answer.graph is not None:
            return _accepted(answer.graph)
        finding = Finding(rule="crash", message="the program sent an answer of the wrong form")
        return VerdictCode.CRASHED, (finding,), None

    # --- the server ---

    def _start(self) -> Worker:
        tensors = self._tensors
        # No secret, only the path of libraries that torch loads at its start on a cluster.
        env = {name: os.environ[name] for name in ("LD_LIBRARY_PATH",) if name in os.environ}
        worker = Worker("openeureka.sandbox.server", env=env, max_blobs=2 * server.MAX_ANSWER)
        header = {
            "spec": self.state,
            "numbers": {name: value for name, value in self.recorded.items() if name not in tensors},
            "tensors": {n: [list(t.shape), str(t.dtype).removeprefix("torch.")] for n, t in tensors.items()},
            "worlds": self._worlds,
            "confined": self._confined,
        }
        try:
            worker.send(header, {name: tensor.numpy().tobytes() for name, tensor in tensors.items()})
            problem = worker.receive(_START_SECONDS).header.get("problem")
        except WorkerTimeout:
            worker.close()
            raise SandboxUnavailable(
                f"The sandbox did not start within {_START_SECONDS:g} s; stop other programs, then try again."
            ) from None
        except WorkerError:
            said = worker.ending() or worker.last_words()
            worker.close()
            raise WorkerError(f"The sandbox server did not start: {said or 'no message'}") from None
        if problem:
            worker.close()
            raise SandboxUnavailable(f"The sandbox failed on a program that is known to be good: {problem}")
        self._worker = worker
        return worker

    def _ask(self, source: str) -> Frame:
        """The server's reply. A server that died or hung is started again, once: the program may not be the reason."""
        outcome = ""
        for _ in range(2):
            worker = self._worker or self._start()
            try:
                worker.send({"source": source, "seconds": SECONDS})
                return worker.receive(SECONDS * server.LONGEST + _GRACE_SECONDS)
            except WorkerError as error:
                self.close()
                outcome = "silent" if isinstance(error, WorkerTimeout) else "crashed"
        return Frame({"outcome": outcome})


def _accepted(graph: RewardGraph) -> _Judgement:
    """The verdict on a graph that a child accepted. It is validated again in this process, where no program ran."""
    try:
        validate(graph)
        return VerdictCode.ACCEPTED, (), graph
    except GraphError as error:
        finding = Finding(rule="operation", message=f"its graph is not allowed: {printable(str(error), 200)}")
        return VerdictCode.CONTRACT, (finding,), None


def _crash(number: object, what: str) -> Finding:
    if number == signal.SIGSYS:
        return Finding(rule="system-call", message="the program tried to start a process or open a connection")
    name = signal.Signals(number).name if isinstance(number, int) and number in set(signal.Signals) else "no answer"
    return Finding(rule="crash", message=f"{what} ended its process ({name})", fix="use plain tensor operations")


def _cleaned(finding: Finding) -> Finding:
    """A finding from a child, with its texts made safe: a child may write anything."""
    return Finding(
        rule=finding.rule if _RULE.fullmatch(finding.rule) else "error",
        message=printable(finding.message),
        fix=printable(finding.fix, _MAX_FIX),
        line=finding.line if finding.line is not None and 0 < finding.line < _MAX_LINE else None,
    )
