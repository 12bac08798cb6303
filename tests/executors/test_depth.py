"""From `eureka run` to a step of physics: few enough calls to be read."""

import sys
from contextlib import nullcontext
from functools import partial
from pathlib import Path

import pytest

from openeureka.cli import main as command
from openeureka.executors import transport
from openeureka.executors.local import LocalExecutor
from openeureka.runs import compose
from openeureka.testing.scripted import ScriptedModel, ToyChecker, reply
from openeureka.worker import Worker


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

    monkeypatch.setattr(transport, "Worker", Noted)
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent))
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", partial(LocalExecutor, module="deep_worker"))
    monkeypatch.setattr(compose, "open_model", lambda config, held: ScriptedModel([reply(1.0)]))
    monkeypatch.setattr(compose, "Sandbox", lambda *_, **__: nullcontext(ToyChecker()))
    monkeypatch.setattr(compose, "record_states", lambda env: {})
    words = ["env=cartpole", "model=scripted", "sample=1", "iteration=1", "threads=1", "video=none", f"dir={tmp_path}"]
    with pytest.raises(SystemExit):
        command.main(["run", *words])
    # Of a reward that no graph of the task's is, as a toy's, the worker dies; the human one gets to the physics.
    # In cli and runs once, then loop, lanes, scheduler, transport.
    assert sent[0] == ["run", "search", "run", "train", "train", "call"]
    assert "main _train train step _advance advance step" in capsys.readouterr().err
