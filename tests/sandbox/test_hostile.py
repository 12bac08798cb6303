"""Every hostile program meets its verdict, and does no harm even where the gate is switched off."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

from openeureka.sandbox import client, confine
from openeureka.sandbox.client import Sandbox
from openeureka.testing.hostile import CORPUS, STATE, Hostile
from openeureka.types import Candidate, VerdictCode

SECRET = "sk-this-must-not-leak"


def states() -> dict[str, torch.Tensor | float]:
    generator = torch.Generator().manual_seed(0)
    drawn = {"pos": (256, 3), "vel": (256, 3), "phase": (256,)}
    recorded: dict[str, torch.Tensor | float] = {n: torch.randn(s, generator=generator) for n, s in drawn.items()}
    recorded["pos"][:8] = 0.0  # type: ignore[index]  # the reset state
    return {**recorded, "dt": 0.02}


@pytest.fixture(scope="module")
def sandbox() -> Iterator[Sandbox]:
    if not confine.support().complete:
        pytest.skip(confine.support().sentence())
    os.environ["SOME_API_KEY"] = SECRET
    with Sandbox(STATE, states()) as running:
        yield running
    del os.environ["SOME_API_KEY"]


@pytest.fixture
def ungated(sandbox: Sandbox, monkeypatch: pytest.MonkeyPatch) -> Sandbox:
    monkeypatch.setattr(sandbox, "_gated", False)
    monkeypatch.setattr(client, "SECONDS", 0.6)
    return sandbox


@pytest.fixture
def canary(tmp_path: Path) -> Path:
    tmp_path.chmod(0o777)
    path = tmp_path / "canary"
    path.write_text("alive")
    path.chmod(0o666)
    return path


def children_of(pid: int) -> list[str]:
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            parent = (process / "stat").read_text().rpartition(")")[2].split()[1]
        except OSError:  # it ended meanwhile
            continue
        if parent == str(pid):
            found.append(process.name)
    return found


def assert_no_harm(sandbox: Sandbox, canary: Path) -> None:
    assert canary.read_text() == "alive"
    assert [path.name for path in canary.parent.iterdir()] == ["canary"]
    assert sandbox._worker is not None and children_of(sandbox._worker.process.pid) == []
    assert torch.get_default_dtype() == torch.float32


@pytest.mark.parametrize("hostile", CORPUS, ids=lambda hostile: hostile.id)
def test_the_sandbox_gives_the_expected_verdict(hostile: Hostile, sandbox: Sandbox, canary: Path) -> None:
    started = time.monotonic()
    verdict = sandbox.check(Candidate.of(hostile.source.replace("CANARY", str(canary))))
    assert (verdict.code, verdict.findings[0].rule) == (hostile.code, hostile.rule), verdict.findings[0].sentence()
    assert verdict.graph is None
    assert time.monotonic() - started < client.SECONDS + 1.0
    assert all(len(finding.sentence()) < 1500 for finding in verdict.findings)
    assert_no_harm(sandbox, canary)


@pytest.mark.parametrize(
    "hostile", [h for h in CORPUS if h.code is VerdictCode.REFUSED], ids=lambda hostile: hostile.id
)
def test_without_the_gate_the_kernel_holds(hostile: Hostile, ungated: Sandbox, canary: Path) -> None:
    verdict = ungated.check(Candidate.of(hostile.source.replace("CANARY", str(canary))))
    text = " ".join(finding.sentence() for finding in verdict.findings)
    assert SECRET not in text
    assert (verdict.graph is not None) == verdict.accepted
    assert_no_harm(ungated, canary)


def test_an_honest_program_is_accepted_after_all_of_them(sandbox: Sandbox) -> None:
    source = "def compute_reward(pos, vel):\n    r = -pos.norm(dim=-1)\n    return r, {'r': r}\n"
    assert sandbox.check(Candidate.of(source)).accepted


def test_a_result_of_the_wrong_shape_names_the_line_of_the_return(sandbox: Sandbox) -> None:
    source = "def compute_reward(pos):\n    r = pos * 2\n\n    return r, {}\n"
    assert sandbox.check(Candidate.of(source)).findings[0].sentence() == (
        "line 4: the reward has shape (N, 3) [shape]; "
        "one number per world is needed, shape (N,): sum or index the last dimension, or squeeze(-1)"
    )
