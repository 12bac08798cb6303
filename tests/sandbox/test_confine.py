"""What a confined child can and cannot do without the gate, and how the server outlives it."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import Mock

import pytest
import torch

from openeureka import worker as workers
from openeureka.errors import SandboxUnavailable, WorkerError
from openeureka.reward import gate
from openeureka.sandbox import client, confine, server
from openeureka.sandbox.answer import Answer
from openeureka.sandbox.client import Sandbox
from openeureka.testing.hostile import STATE
from openeureka.types import Candidate, Verdict, VerdictCode
from openeureka.worker import Frame, WorkerDied, WorkerTimeout
from sandbox.clock import processor_seconds
from sandbox.ungated import Ungated

pytestmark = pytest.mark.skipif(not confine.support().complete, reason=confine.support().sentence())
RECORDED = {"pos": torch.randn(64, 3), "vel": torch.randn(64, 3), "phase": torch.randn(64), "dt": 0.02}


@pytest.fixture(scope="module")
def sandbox() -> Iterator[Sandbox]:
    with Ungated(STATE, RECORDED) as running:
        yield running


def run(sandbox: Sandbox, body: str) -> Verdict:
    lines = "\n".join(f"    {line}" for line in body.split("\n"))
    return sandbox.check(Candidate.of(f"def f(pos):\n{lines}\n    return pos[:, 0] * 1.0, {{}}\n"))


def test_without_the_gate_a_harmless_program_passes(sandbox: Sandbox) -> None:
    assert run(sandbox, "import math").accepted  # so the refusals below come from the kernel


@pytest.mark.parametrize(
    "body",
    [
        "open('/etc/passwd')",
        "open('/proc/self/environ')",
        "open('/tmp/x', 'w')",
        "import os; os.listdir('/')",
        "import os; os.mkdir('/tmp/x')",
        "import os; os.unlink('/tmp/x')",
        "import os; os.chmod('/tmp', 0)",
        "import os; os.kill(os.getppid(), 9)",
        "import os; os.kill(-1, 15)",
        "import os; os.setsid()",
        "import os; os.setuid(0)",
        "import os; os.setpgid(0, os.getppid())",
        "import ctypes, os; ctypes.CDLL(None, use_errno=True).process_vm_readv and open('/proc/1/mem')",
        "import resource; resource.setrlimit(resource.RLIMIT_CPU, (100, 100))",
    ],
)
def test_files_signals_and_identity_are_out_of_reach(sandbox: Sandbox, body: str) -> None:
    verdict = run(sandbox, body)
    assert verdict.code is VerdictCode.CONTRACT
    assert "PermissionError" in verdict.findings[0].message or "not allowed" in verdict.findings[0].message
    assert verdict.findings[0].line == 2


@pytest.mark.parametrize(
    "body",
    [
        "import os; os.fork()",
        "import os; os.system('id')",
        "import os; os.execv('/bin/sh', ['sh'])",
        "import os; os.posix_spawn('/bin/sh', ['sh'], {})",
        "import _socket; _socket.socket()",
        "import _thread; _thread.start_new_thread(print, ())",
        "import ctypes; ctypes.CDLL(None).ptrace(16, 1, 0, 0)",
    ],
)
def test_processes_threads_and_sockets_kill_the_child(sandbox: Sandbox, body: str) -> None:
    verdict = run(sandbox, body)
    assert (verdict.code, verdict.findings[0].rule) == (VerdictCode.CRASHED, "system-call")


@pytest.mark.parametrize("body", ["x = [0] * 10**10", "x = bytearray(10**11)", "x = torch.zeros(10**10)"])
def test_memory_is_bounded(sandbox: Sandbox, body: str) -> None:
    verdict = run(sandbox, body)
    assert verdict.code is VerdictCode.CONTRACT
    assert "MemoryError" in verdict.findings[0].message or "memory" in verdict.findings[0].message


def test_the_environment_holds_nothing_of_ours(sandbox: Sandbox) -> None:
    own = "{'LC_CTYPE', 'LD_LIBRARY_PATH', 'TORCHINDUCTOR_CACHE_DIR'}"  # Python and torch set these
    verdict = run(sandbox, f"import os\nraise ValueError(sorted(set(os.environ) - {own}))")
    assert verdict.findings[0].message == "ValueError: []"


@pytest.mark.skipif(os.geteuid() != 0 or confine._only_user(), reason="only root has rights to give up")
def test_root_becomes_nobody(sandbox: Sandbox) -> None:
    verdict = run(
        sandbox, "import os\nraise ValueError(os.getuid() > 60000 and os.getgid() > 60000 and os.getgroups())"
    )
    # Only nobody reaches `getgroups`, which is not among the allowed calls.
    assert "PermissionError" in verdict.findings[0].message


def test_a_server_that_cannot_start_gives_the_last_line_and_gets_the_path_of_libraries_alone(monkeypatch) -> None:
    given = {}

    def broken(_: str, *, env: dict[str, str], max_blobs: int) -> workers.Worker:
        given.update(env)
        return workers.Worker("openeureka.no_such_module", env=env)

    monkeypatch.setenv("LD_LIBRARY_PATH", "libraries")
    monkeypatch.setattr(client, "Worker", broken)
    with pytest.raises(WorkerError) as caught, Sandbox(STATE, RECORDED, unsafe=True):
        pass
    assert given == {"LD_LIBRARY_PATH": "libraries"}
    assert str(caught.value).startswith("The sandbox server did not start: ")
    assert str(caught.value).endswith("No module named openeureka.no_such_module")
    assert "Traceback" not in str(caught.value) and "\n" not in str(caught.value)


def test_a_child_that_cannot_be_confined_runs_nothing_and_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(**_: object) -> None:
        raise OSError(errno.EPERM, "root cannot become another user here; start it as an ordinary user")

    def work() -> Answer:
        raise AssertionError

    monkeypatch.setattr(server, "confine", refused)
    outcome = server._Child(work, confined=True).finish(20.0)
    (finding,) = Answer.read(outcome.answer).findings
    said = "its process cannot be confined: root cannot become another user here; start it as an ordinary user"
    assert (finding.rule, finding.message) == ("unconfined", said)
    # The person who starts a search reads the same sentence, from the server's warm-up.
    for work_done_once in ("_collapse", "gc"):
        monkeypatch.setattr(server, work_done_once, Mock())
    assert server._warm_up(server._Bench(STATE, RECORDED, 0, confined=True)) == said


ALONE = ["unshare", "--user", "--map-root-user"]
CONFINED = """
import os
from openeureka.sandbox import confine
confine.confine(kernel={kernel})
print(os.getuid())
open("/etc/passwd")
"""


@pytest.mark.parametrize("kernel", [True, False])
def test_root_of_a_namespace_without_other_users_is_confined_as_it_is(kernel: bool) -> None:
    if shutil.which("unshare") is None or subprocess.run([*ALONE, "true"], capture_output=True).returncode:
        pytest.skip("no user namespaces here")
    program = [sys.executable, "-c", CONFINED.format(kernel=kernel)]
    done = subprocess.run([*ALONE, *program], capture_output=True, text=True)
    assert done.stdout == "0\n", done.stderr
    refusal = "PermissionError" if kernel else "OSError: [Errno 24] Too many open files"
    assert refusal in done.stderr


def test_a_root_that_cannot_step_down_is_told_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(_: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(confine, "_only_user", lambda: False)
    monkeypatch.setattr(os, "setgroups", refused)
    with pytest.raises(PermissionError, match="root cannot become another user here .* CAP_SETUID"):
        confine._drop_privileges()


def test_only_the_answer_pipe_is_open(sandbox: Sandbox) -> None:
    body = """import os, errno
found = []
for number in range(64):
    try:
        os.lseek(number, 0, 1)
        found.append(number)
    except OSError as error:
        if error.errno != errno.EBADF:
            found.append(number)
raise ValueError(found)"""
    assert run(sandbox, body).findings[0].message == "ValueError: [0, 1, 2, 3]"  # null, null, null and the pipe


def test_a_child_inherits_no_compiler(sandbox: Sandbox) -> None:
    body = "import sys\nraise ValueError([name for name in sys.modules if name.startswith('torch._dynamo')])"
    assert run(sandbox, body).findings[0].message == "ValueError: ['torch._dynamo']"  # only the empty stand-in


def test_a_program_that_never_ends_is_ended(sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "SECONDS", 0.3)
    before = processor_seconds(sandbox)
    assert run(sandbox, "while True:\n    pass").code is VerdictCode.TIMEOUT
    assert processor_seconds(sandbox) - before < confine.CPU_SECONDS  # the kernel did not have to end it


def test_a_program_that_waits_is_ended_too(sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "SECONDS", 0.4)
    started = time.monotonic()
    verdict = run(sandbox, "import time; time.sleep(60)")
    assert verdict.code is VerdictCode.TIMEOUT
    said = "the program did nothing for most of 6.4 s, on a machine with processors to spare"
    assert verdict.findings[0].message == said  # 6.4 = 0.4 * 16
    assert time.monotonic() - started > 0.4 * (4 + 16)


def test_a_child_that_had_part_of_its_time_when_the_clock_ended_it_has_waited() -> None:
    def work() -> Answer:
        while time.process_time() < 0.3:
            pass
        return wait()

    assert server._Child(work, confined=False).finish(0.5).kind == "waited"


def test_a_child_that_only_computes_uses_up_its_time() -> None:
    assert server._Child(server._compute, confined=False).finish(0.1, patience=3000).kind == "timeout"


def test_a_child_that_does_not_read_is_ended_too() -> None:
    started = time.monotonic()
    outcome = server._Child(wait, confined=False).finish(0.5, bytes(200_000))  # three times what a pipe holds
    assert outcome.kind == "waited" and time.monotonic() - started < 300  # and not 600


def test_the_answer_of_a_child_that_ended_before_it_read_counts() -> None:
    child = server._Child(lambda: Answer(returns=7), confined=False)
    os.waitid(os.P_PID, child._pid, os.WEXITED | os.WNOWAIT)  # it has ended before its input is sent
    outcome = child.finish(20.0, b"a graph")
    assert outcome.kind == "answer" and Answer.read(outcome.answer).returns == 7


def test_a_child_that_ends_without_an_answer_has_crashed_though_its_input_was_not_read() -> None:
    child = server._Child(lambda: os._exit(0), confined=False)
    os.waitid(os.P_PID, child._pid, os.WEXITED | os.WNOWAIT)
    assert child.finish(20.0, b"a graph").kind == "crashed"


def wait() -> Answer:
    time.sleep(600)
    return Answer()


@pytest.mark.parametrize(
    ("kinds", "witness", "what"),
    [
        (["waited", "answer"], "none is asked", "answer"),
        (["waited", "waited"], "timeout", "waited"),  # the witness had its time: the program is at fault
        (["waited", "waited", "waited"], "waited", "busy"),
        (["waited", "waited", "timeout"], "waited", "timeout"),  # the program loops, even on a busy machine
        (["waited", "waited", "answer"], "waited", "answer"),
    ],
)
def test_a_child_that_never_woke_up_gets_a_successor_and_then_a_witness(
    kinds: list[str], witness: str, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    children = iter(kinds)
    monkeypatch.setattr(server, "_judge_once", lambda *_: ("program", server._Outcome(next(children))))
    monkeypatch.setattr(server, "_Child", lambda *_, **__: Mock(finish=lambda *_, **__: server._Outcome(witness)))
    assert server._judge(None, None, 2.0) == ("program", server._Outcome(what))  # pyright: ignore[reportArgumentType]
    assert not list(children)


def test_a_machine_that_is_too_busy_is_no_verdict_on_a_program(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Sandbox, "_ask", lambda *_: Frame({"outcome": "busy", "where": "program"}))
    with pytest.raises(
        SandboxUnavailable, match="too busy .* no process gets 2 s of processor time in 32 s; stop other"
    ):
        Sandbox(STATE, RECORDED).check(Candidate.of("def f(pos):\n    return pos[:, 0], {}\n"))


def test_a_program_that_others_hold_up_has_its_time(sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "SECONDS", 1.5)
    verdict = run(sandbox, "import time; time.sleep(0.8)")
    assert verdict.code is VerdictCode.ACCEPTED and verdict.seconds > 1.5


def test_an_exit_status_is_no_verdict(sandbox: Sandbox) -> None:
    assert run(sandbox, "import os; os._exit(0)").code is VerdictCode.CRASHED


def forged(answer: str) -> str:
    return f"import os, json, struct\na = {answer}\nos.write(3, struct.pack('<I', len(a)) + a)\nos._exit(0)"


@pytest.mark.parametrize(
    ("answer", "code"),
    [
        ("b'{}'", VerdictCode.CRASHED),
        ("b'[]'", VerdictCode.CRASHED),
        ("b'\\xff\\xfe'", VerdictCode.CRASHED),
        ("b'[' * 100000", VerdictCode.CRASHED),
        ('json.dumps({"findings": []}).encode()', VerdictCode.CRASHED),
        ('json.dumps({"findings": 7}).encode()', VerdictCode.CRASHED),
        ('json.dumps({"graph": "{}", "lines": "x"}).encode()', VerdictCode.CRASHED),
        ('json.dumps({"graph": 5}).encode()', VerdictCode.CRASHED),
    ],
)
def test_a_forged_answer_is_never_accepted(sandbox: Sandbox, answer: str, code: VerdictCode) -> None:
    verdict = run(sandbox, forged(answer))
    assert (verdict.code, verdict.graph) == (code, None)
    assert verdict.findings


def test_a_forged_graph_that_breaks_the_contract_is_refused(sandbox: Sandbox) -> None:
    """The child claims that a reward which couples worlds is fine. Another child judges the graph itself."""
    coupled = ["mean.default", [{"ref": 1}], {}], ["sub.Tensor", [{"ref": 1}, {"ref": 2}], {}]
    verdict = run(sandbox, forged_graph(INPUT, FIRST, *coupled, lines=[1, 1, 1, 1]))
    assert verdict.findings[0].rule == "coupling"


def forged_graph(*nodes: list[object], lines: object = ()) -> str:
    """A forged answer with a graph of these nodes. Its reward is the last node."""
    named = [dict(zip(("op", "args", "kwargs"), node, strict=True)) for node in nodes]
    data = {"version": 1, "nodes": named, "reward": len(nodes) - 1, "components": []}
    return forged(repr(json.dumps({"graph": data, "lines": lines}).encode()))


INPUT, FIRST = ["input", ["pos"], {}], ["select.int", [{"ref": 0}, 1, 0], {}]
LEAST = ["full.default", [[{"n": 1}], -(2**63 - 1)], {"dtype": "int64"}], ["sub.Scalar", [{"ref": 2}, 1], {}]
MINUS_ONE = ["full.default", [[{"n": 1}], -1], {"dtype": "int64"}]
TRUNCATED = {"rounding_mode": "trunc"}
FATAL = {
    "a truncated division of integers": (["div.Tensor_mode", [{"ref": 3}, {"ref": 4}], TRUNCATED], "integer division"),
    "a truncated division by a number": (["div.Scalar_mode", [{"ref": 3}, -1], TRUNCATED], "integer division"),
    "a range that fills the memory": (["arange.start_step", [0, 10**12, 1], {}], "too large"),
}


@pytest.mark.parametrize("name", FATAL)
def test_a_forged_graph_that_would_end_its_process_is_a_verdict(sandbox: Sandbox, name: str) -> None:
    node, reason = FATAL[name]
    scaled = ["mul.Tensor", [{"ref": 5}, 0.0], {}]
    last = ["add.Tensor", [{"ref": 1}, {"ref": 6}], {}]
    verdict = run(sandbox, forged_graph(INPUT, FIRST, *LEAST, MINUS_ONE, node, scaled, last))
    assert verdict.code is VerdictCode.CONTRACT and reason in verdict.findings[0].message


def test_what_no_output_of_a_forged_graph_needs_is_dropped_before_it_runs(sandbox: Sandbox) -> None:
    wide = ["expand.default", [{"ref": 1}, [4000, {"n": 1}]], {}]
    verdict = run(sandbox, forged_graph(INPUT, FIRST, wide, *[["sort.default", [{"ref": 2}], {}]] * 150, FIRST))
    assert verdict.graph is not None and [node.op for node in verdict.graph.nodes] == ["input", "select.int"]


def test_the_parts_of_a_value_count(sandbox: Sandbox) -> None:
    wide = ["expand.default", [{"ref": 1}, [4000, {"n": 1}]], {}]
    sorts = [["sort.default", [{"ref": 2}, i % 2], {}] for i in range(2)]
    nodes = [INPUT, FIRST, wide, *sorts]
    verdict = run(
        sandbox, forged_graph(*nodes, ["getitem", [{"ref": 4}, 0], {}], ["select.int", [{"ref": 5}, 0, 0], {}])
    )
    assert verdict.findings[0].rule == "memory"  # 4,000 values and 4,000 indices per world; the limit is 4,096


TABLES = """total, row = pos[:, 0], [-(1 + place) * 1e-30 / 7 for place in range(4000)]
for turn in range(44):
    row = [1.1 * number for number in row]
    total = total + torch.tensor(row).sum()
pos = total[:, None]"""


@pytest.mark.parametrize(
    "body", [TABLES, "import os\nos.write(3, b'\\xff' * 64)\nos._exit(0)"], ids=["tables", "forged"]
)
def test_a_graph_of_too_many_numbers_is_no_crash(sandbox: Sandbox, body: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "SECONDS", confine.CPU_SECONDS - 0.5)  # a slow machine needs 2 s to build the tables
    verdict = run(sandbox, body)
    assert (verdict.code, verdict.findings[0].rule) == (VerdictCode.CONTRACT, "memory")
    assert verdict.findings[0].sentence() == (
        "its graph holds too many numbers [memory]; compute tables with torch operations, from a few numbers"
    )


def test_lines_that_a_child_forges_are_lines(sandbox: Sandbox) -> None:
    coupled = ["mean.default", [{"ref": 1}], {}], ["sub.Tensor", [{"ref": 1}, {"ref": 2}], {}]
    for line in (10**15, None):
        verdict = run(sandbox, forged_graph(INPUT, FIRST, *coupled, lines=[line] * 4))
        assert (verdict.findings[0].rule, verdict.findings[0].line) == ("coupling", None)
    for line in (-1, 10**4000, True, "x"):  # an answer of the wrong form
        verdict = run(sandbox, forged_graph(INPUT, FIRST, *coupled, lines=[line] * 4))
        assert (verdict.code, verdict.findings[0].line) == (VerdictCode.CRASHED, None)


def test_the_death_of_a_child_that_runs_a_graph_is_a_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "_examine", lambda *_: os.kill(os.getpid(), signal.SIGFPE))
    bench = server._Bench(STATE, RECORDED, 0, confined=False)
    program = gate.check("def f(pos):\n    return pos[:, 0], {}\n", STATE)
    assert isinstance(program, gate.Program)
    where, outcome = server._judge(program, bench, 20.0)
    assert (where, outcome) == ("graph", server._Outcome("crashed", b"", signal.SIGFPE))
    answers = Frame({"outcome": outcome.kind, "where": where, "signal": outcome.died_of})
    monkeypatch.setattr(Sandbox, "_ask", lambda *_: answers)
    verdict = Sandbox(STATE, RECORDED).check(Candidate.of("def f(pos):\n    return pos[:, 0], {}\n"))
    assert (verdict.code, verdict.findings[0].message) == (VerdictCode.CRASHED, "its graph ended its process (SIGFPE)")


def test_text_from_a_child_is_one_printable_line(sandbox: Sandbox) -> None:
    verdict = run(sandbox, "raise ValueError('\\x1b[31mred\\u202e' + 'x' * 10000)")
    message = verdict.findings[0].message
    assert message.isprintable() and len(message) <= 500


def test_a_server_that_is_killed_is_started_again(sandbox: Sandbox) -> None:
    assert sandbox._worker is not None
    sandbox._worker.process.kill()
    sandbox._worker.process.wait()
    assert run(sandbox, "pass").accepted


class Worker:
    """Stands in for a server that hangs, dies or answers."""

    def __init__(self, error: type[WorkerError] | None) -> None:
        self.error = error

    def send(self, *_: object) -> None:
        pass

    def receive(self, timeout: float) -> Frame:
        if self.error is not None:
            raise self.error
        return Frame({"outcome": "refused"}, {"answer": b'{"findings": [{"rule": "size", "message": "long"}]}'})

    def close(self) -> None:
        pass


@pytest.mark.parametrize(
    ("first", "second", "code", "message"),
    [
        (WorkerTimeout, None, VerdictCode.REFUSED, "long"),
        (WorkerDied, None, VerdictCode.REFUSED, "long"),
        (WorkerTimeout, WorkerTimeout, VerdictCode.TIMEOUT, "nothing was heard of it again, twice"),
        (WorkerTimeout, WorkerDied, VerdictCode.CRASHED, "the program ended its process (no answer)"),
    ],
)
def test_a_server_that_hangs_or_dies_has_a_successor_once(
    first: type[WorkerError],
    second: type[WorkerError] | None,
    code: VerdictCode,
    message: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    servers = iter([Worker(first), Worker(second)])
    monkeypatch.setattr(Sandbox, "_start", lambda _: next(servers))
    verdict = Sandbox(STATE, RECORDED).check(Candidate.of("def f(pos):\n    return pos[:, 0], {}\n"))
    assert (verdict.code, verdict.findings[0].message) == (code, message)
    assert not list(servers)


def test_a_server_that_is_not_up_in_time_says_to_make_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "Worker", lambda *_, **__: Worker(WorkerTimeout))
    with pytest.raises(SandboxUnavailable, match=r"^The sandbox did not start within 120 s; stop other programs, "):
        Sandbox(STATE, RECORDED).check(Candidate.of("def f(pos):\n    return pos[:, 0], {}\n"))


def test_a_kernel_without_confinement_stops_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(confine, "support", lambda: confine.Support("x86_64", 0, True))
    with pytest.raises(SandboxUnavailable, match="Landlock"):
        Sandbox(STATE, RECORDED).__enter__()


def test_unsafe_probes_without_the_kernel_and_leaves_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(confine, "support", lambda: confine.Support("riscv64", 0, False))
    source = "def f(pos):\n    return pos[:, 0], {}\n"
    with Sandbox(STATE, RECORDED, unsafe=True) as running:
        assert running.check(Candidate.of(source)).accepted
        assert running._worker is not None
        pid = running._worker.process.pid
    assert not Path(f"/proc/{pid}").exists()


def test_the_report_for_doctor_names_what_is_missing() -> None:
    assert confine.Support("x86_64", 7, True).sentence() == (
        "confinement works: seccomp and Landlock (ABI 7) on x86_64"
    )
    assert "(ABI 3, an older one: only seccomp blocks TCP or signals)" in confine.Support("x86_64", 3, True).sentence()
    missing = confine.Support("riscv64", 0, False).sentence()
    assert "riscv64" in missing and "seccomp" in missing and "Landlock" in missing


def test_recorded_states_of_every_variable_are_needed() -> None:
    with pytest.raises(ValueError, match="vel"):
        Sandbox(STATE, {"pos": torch.zeros(4, 3), "phase": torch.zeros(4), "dt": 0.1})
