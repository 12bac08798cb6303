"""Every hostile program gets the verdict that it should, and does no harm even without the gate."""

from __future__ import annotations

import ctypes
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from openeureka.codec import encode
from openeureka.reward import graph
from openeureka.reward.validate import COMPONENT_NAME
from openeureka.sandbox import client, confine, server
from openeureka.sandbox.client import Sandbox
from openeureka.testing.hostile import CORPUS, STATE, Hostile, Layer
from openeureka.training.population import ABSURD
from openeureka.training.rewards import LaneRewards
from openeureka.types import Candidate, Verdict
from sandbox.clock import processor_seconds
from sandbox.states import recorded
from sandbox.ungated import Ungated

SECRET = "sk-this-must-not-leak"
GOLDEN = Path(__file__).parents[1] / "golden" / "hostile.md"
THEIR_WORDS = ("error", "syntax")
"""Rules whose message is Python's or torch's own text, which changes with their versions."""
LAST = 93
"""The highest number of an idea."""
UNGATED = [h for h in CORPUS if h.layer is Layer.GATE and h.name != "sleep"]
"""Without `sleep`, which would wait until its time is over; `test_confine.py` has such a program."""
HOW_DEEP_PYTHON_READS = 49
"""The idea whose message depends on Python's version."""
PR_SET_CHILD_SUBREAPER = 36


@pytest.fixture(scope="module")
def surroundings() -> Iterator[None]:
    """Sets a secret to steal, and lets this process see every process that escapes."""
    if not confine.support().complete:
        pytest.skip(confine.support().sentence())
    os.environ["SOME_API_KEY"] = SECRET
    # A process that outlives its parent becomes a child of this one, so `descendants` finds it.
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1)
    yield
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 0)
    del os.environ["SOME_API_KEY"]


@pytest.fixture(scope="module")
def sandbox(surroundings: None) -> Iterator[Sandbox]:
    with Sandbox(STATE, recorded()) as running:
        yield running


@pytest.fixture(scope="module")
def ungated(surroundings: None) -> Iterator[Sandbox]:
    with Ungated(STATE, recorded()) as running:
        yield running


@pytest.fixture
def canary(tmp_path: Path) -> Path:
    tmp_path.chmod(0o777)
    path = tmp_path / "canary"
    path.write_text("alive")
    path.chmod(0o666)
    return path


@pytest.fixture(scope="module")
def golden() -> Iterator[dict[str, str]]:
    """What each program's author is told, by the id of the program."""
    known = dict(line.split(": ", 1) for line in GOLDEN.read_text(encoding="utf-8").splitlines())
    yield known
    if os.environ.get("EUREKA_GOLDEN") == "write":
        told = [f"{hostile.id}: {known[hostile.id]}\n" for hostile in CORPUS if hostile.id in known]
        GOLDEN.write_text("".join(told), encoding="utf-8")


def descendants(pid: int) -> set[int]:
    """All descendants of a process, zombies included."""
    parents: dict[int, int] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(stat.parent.name)] = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:  # the process ended meanwhile
            continue
    found, size = {pid}, 0
    while size < len(found):
        size = len(found)
        found |= {child for child, parent in parents.items() if parent in found}
    return found - {pid}


class Watch:
    """Records what a program could harm, and asserts later that all of it is unchanged."""

    def __init__(self, sandbox: Sandbox, canary: Path) -> None:
        self.sandbox, self.canary = sandbox, canary
        self._before = self._world()

    def _world(self) -> dict[str, object]:
        worker = self.sandbox._worker
        assert worker is not None
        tensors = {n: v for n, v in self.sandbox.recorded.items() if isinstance(v, torch.Tensor)}
        return {
            "canary": self.canary.read_text(),
            "folder": sorted(path.name for path in self.canary.parent.iterdir()),
            "inputs": {name: tensor.numpy().tobytes() for name, tensor in tensors.items()},
            "random numbers": torch.get_rng_state().numpy().tobytes(),
            "dtype": torch.get_default_dtype(),
            "threads": torch.get_num_threads(),
            "gradients": torch.is_grad_enabled(),
            "processes other than the server": descendants(os.getpid()) - {worker.process.pid},
        }

    def assert_no_harm(self, verdict: Verdict) -> None:
        assert self._world() == self._before
        assert self.sandbox._worker is not None
        text = [finding.sentence() for finding in verdict.findings]
        text += [encode(verdict.graph)] if verdict.graph else []
        assert SECRET not in " ".join((*text, self.sandbox._worker.stderr_tail(1 << 20)))
        assert all(len(sentence) < 1500 and sentence.isprintable() for sentence in text[: len(verdict.findings)])
        assert (verdict.graph is not None) == verdict.accepted


@pytest.mark.parametrize("hostile", CORPUS, ids=lambda hostile: hostile.id)
def test_the_named_layer_stops_it(hostile: Hostile, sandbox: Sandbox, canary: Path, golden: dict[str, str]) -> None:
    watch = Watch(sandbox, canary)
    before = processor_seconds(sandbox)
    verdict = sandbox.check(Candidate.of(hostile.source.replace("CANARY", str(canary))))
    seconds = processor_seconds(sandbox) - before
    first = verdict.findings[0] if verdict.findings else None
    assert (verdict.code, first.rule if first else "") == (hostile.code, hostile.rule), first and first.sentence()
    # On a busy machine a program is tried once more after the tries, and a child without a program computes too.
    assert seconds < (len(server.TRIES) + 2) * client.SECONDS + 2.0
    watch.assert_no_harm(verdict)
    if first is not None and first.rule not in THEIR_WORDS and hostile.number != HOW_DEEP_PYTHON_READS:
        assert first.fix
        if os.environ.get("EUREKA_GOLDEN") == "write":
            golden[hostile.id] = first.sentence()
        assert first.sentence() == golden[hostile.id]


@pytest.mark.parametrize("hostile", UNGATED, ids=lambda hostile: hostile.id)
def test_without_the_gate_the_kernel_holds(
    hostile: Hostile, ungated: Sandbox, canary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "SECONDS", 0.6)
    watch = Watch(ungated, canary)
    watch.assert_no_harm(ungated.check(Candidate.of(hostile.source.replace("CANARY", str(canary)))))


@pytest.mark.parametrize("hostile", [h for h in CORPUS if h.layer is Layer.GRAPH], ids=lambda hostile: hostile.id)
def test_the_graph_of_an_odd_program_is_harmless(hostile: Hostile, sandbox: Sandbox) -> None:
    accepted = sandbox.check(Candidate.of(hostile.source)).graph
    assert accepted is not None
    states = recorded()
    reward, components = graph.CompiledReward(accepted, STATE)(states)
    for value in (reward, *components.values()):
        assert value.shape == (256,) and value.dtype == torch.float32 and value.stride() == (1,)
        assert torch.isfinite(value).all() and not value.requires_grad
        value.fill_(7.0)  # would change an input that shared its memory
    assert all(COMPONENT_NAME.fullmatch(name) for name in components)
    fresh = recorded()
    assert all(torch.equal(states[name], fresh[name]) for name in ("pos", "vel", "phase"))  # type: ignore[arg-type]


@pytest.mark.parametrize("hostile", [h for h in CORPUS if h.layer is Layer.TRAINING], ids=lambda hostile: hostile.id)
def test_training_sees_what_no_recorded_state_showed(hostile: Hostile, sandbox: Sandbox) -> None:
    """`LaneRewards` hands such rewards on. The trainer's guard stops them: see `training/test_guards.py`."""
    accepted = sandbox.check(Candidate.of(hostile.source)).graph
    assert accepted is not None
    cpu = torch.device("cpu")
    zeros: Any = SimpleNamespace(
        env="toy", spec=STATE, device=cpu, num_envs=4, human_reward=lambda state: torch.zeros(4)
    )
    reward, _, _ = LaneRewards(zeros, [accepted], worlds=4)(
        {
            "pos": torch.ones(4, 3),
            "vel": torch.ones(4, 3),
            "phase": torch.tensor([0.0, 1.0, 2.0, 100.0]),
            "dt": 0.02,
        }
    )
    assert not bool((reward.abs() <= ABSURD).all())


def test_the_corpus_covers_the_list() -> None:
    """Ideas 83, 89 and 90 are about replies, duplicate programs and dying processes, and are tested elsewhere."""
    assert {hostile.number for hostile in CORPUS} == set(range(1, LAST + 1)) - {83, 89, 90}
    assert all(count == 1 for count in Counter(hostile.id for hostile in CORPUS).values())


def test_an_honest_program_is_accepted_after_all_of_them(sandbox: Sandbox) -> None:
    source = "def compute_reward(pos, vel):\n    r = -pos.norm(dim=-1)\n    return r, {'r': r}\n"
    assert sandbox.check(Candidate.of(source)).accepted


def test_a_result_of_the_wrong_shape_names_the_line_of_the_return(sandbox: Sandbox) -> None:
    source = "def compute_reward(pos):\n    r = pos * 2\n\n    return r, {}\n"
    assert sandbox.check(Candidate.of(source)).findings[0].sentence() == (
        "line 4: the reward has shape (N, 3) [shape]; "
        "one number per world is needed, shape (N,): sum or index the last dimension, or squeeze(-1)"
    )
