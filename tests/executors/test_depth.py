"""From `eureka run` to a physics step: a call stack short enough to read."""

import sys
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import pytest

from openeureka.cli import main as command
from openeureka.executors import transport
from openeureka.executors.local import LocalExecutor
from openeureka.runs import compose
from openeureka.testing.scripted import ScriptedModel, reply
from openeureka.types import Candidate, Node, RewardGraph, Verdict, VerdictCode
from openeureka.worker import Worker

ANGLE = RewardGraph(nodes=(Node("input", ("pole_angle",)),), reward=0, components=())


def test_few_calls_of_ours_lie_between_the_command_and_a_step_of_physics(monkeypatch, tmp_path, capsys):
    sent: list[list[str]] = []

    class Noted(Worker):
        def send(self, header, blobs=None) -> None:
            frame, names = sys._getframe(1), []
            while frame is not None and frame.f_code is not command.run.__code__:
                if "/openeureka/" in frame.f_code.co_filename:
                    names.insert(0, frame.f_code.co_name)
                frame = frame.f_back
            sent.append(names)
            super().send(header, blobs)

    class Checker:
        def check(self, candidate: Candidate) -> Verdict:
            return Verdict(candidate=candidate.id, code=VerdictCode.ACCEPTED, graph=ANGLE)

    monkeypatch.setattr(transport, "Worker", Noted)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", partial(LocalExecutor, module="deep_worker"))
    monkeypatch.setattr(compose, "open_model", lambda config, held: ScriptedModel([reply(1.0)]))
    monkeypatch.setattr(compose, "Sandbox", lambda *_, **__: nullcontext(Checker()))
    monkeypatch.setattr(compose, "record_states", lambda env: {})
    words = ["env=cartpole", "model=scripted", "sample=1", "iteration=1", "threads=1", "video=none", f"dir={tmp_path}"]
    with pytest.raises(SystemExit):
        command.main(["run", *words])
    # One call each in cli, runs, loop, lanes, scheduler and transport.
    assert sent[0] == ["run", "search", "run", "train", "train", "call"]
    assert "main _train train step _advance advance step" in capsys.readouterr().err
