"""Mirrors of runs in trackers. wandb and MLflow are fakes that record their calls; TensorBoard's own library reads the
files that are written for it."""

from __future__ import annotations

import sys
from contextlib import suppress
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from report.scripted import search_in
from tensorboard.backend.event_processing.event_file_loader import EventFileLoader
from tensorboard.compat.tensorflow_stub.errors import DataLossError

from openeureka.config import RunConfig
from openeureka.display import trackers
from openeureka.errors import ConfigError
from openeureka.events import Began, everyone
from openeureka.film.mp4 import encode
from openeureka.report import tensorboard
from openeureka.report.view import VIDEO
from openeureka.testing.scripted import reply


def mirror(directory: Path, log: str) -> Path:
    """A toy search that is mirrored, with a film of each candidate."""
    config = RunConfig(env="toy", sample=2, iteration=1, refill=0, seeds=1, log=log)
    with trackers.mirrored(directory, config) as mirrors:
        search_in(directory, [reply(7), reply(8)], tell=everyone(*mirrors), log=log)
        for lane in (directory / "lanes").iterdir():
            pictures = (np.full((48, 64, 3), 50 * shade, np.uint8) for shade in range(5))
            (lane / VIDEO).write_bytes(encode(pictures, rate=10))
        for each in mirrors:
            each.films()
    return directory


class FakeWandb(ModuleType):
    def __init__(self) -> None:
        super().__init__("wandb")
        self.calls: list[tuple[str, Any]] = []
        self.Table = lambda columns, data: ("table", data[0][0])
        self.Video = lambda path, format: ("video", Path(path).read_bytes()[4:8])
        self.summary: dict[str, float] = {}
        self.id = "abc"

    def init(self, **settings: Any) -> FakeWandb:
        self.calls.append(("init", settings))
        return self

    def define_metric(self, *_: str, **__: str) -> None: ...

    def log(self, values: dict[str, Any]) -> None:
        self.calls.append(("log", values))

    def finish(self) -> None:
        self.calls.append(("finish", None))


def test_wandb_gets_settings_curves_texts_and_films(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    fake = FakeWandb()
    monkeypatch.setitem(sys.modules, "wandb", fake)
    mirror(tmp_path / "run", "wandb")
    kinds = [kind for kind, _ in fake.calls]
    assert kinds[0] == "init" and kinds[-1] == "finish" and kinds.count("init") == 1
    settings = fake.calls[0][1]
    assert settings["name"] == "run" and settings["config"]["sample"] == 2 and settings["id"] is None
    told = {name: value for kind, values in fake.calls if kind == "log" for name, value in values.items()}
    assert "return 7" in told["programs/g0s0"][1]
    assert any(name.endswith("/fitness") and isinstance(value, float) for name, value in told.items())
    assert ("video", b"ftyp") in told.values()
    assert fake.summary["held-out F"] > 0
    with trackers.mirrored(tmp_path / "run", RunConfig(env="toy", log="wandb")) as (again,):
        again._tell("numbers", {"x": 1.0}, 0)
    assert [values["id"] for kind, values in fake.calls if kind == "init"] == [None, "abc"]  # resumes it


def test_a_run_that_goes_on_tells_no_generation_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    fake = FakeWandb()
    monkeypatch.setitem(sys.modules, "wandb", fake)
    for _ in range(2):
        mirror(tmp_path / "run", "wandb")
    assert [values["epoch"] for kind, values in fake.calls if kind == "log" and "best F" in values] == [0]


def test_mlflow_gets_settings_curves_texts_and_films(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    calls: list[tuple[str, Any]] = []
    fake = ModuleType("mlflow")

    def told(name: str) -> Any:
        return lambda *args, **settings: calls.append((name, (args, settings)))

    for name in ("set_experiment", "log_params", "log_metrics", "log_text", "log_artifact", "end_run"):
        setattr(fake, name, told(name))
    fake.start_run = lambda **settings: SimpleNamespace(info=SimpleNamespace(run_id="m1"))  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "mlflow", fake)
    mirror(tmp_path / "run", "mlflow")
    names = [name for name, _ in calls]
    assert {"log_params", "log_metrics", "log_text", "log_artifact"} <= set(names) and names[-1] == "end_run"
    assert "m1" in (tmp_path / "run" / trackers.MEMORY).read_text()


def test_tensorboard_reads_curves_texts_and_moving_pictures(tmp_path: Path):
    mirror(tmp_path / "run", "tensorboard")
    events = EventFileLoader(str(tmp_path / "run" / tensorboard.EVENTS)).Load()
    values = {value.tag: value for event in events for value in event.summary.value}
    assert b"return 7" in values["programs/g0s0"].tensor.string_val[0]
    assert b'"sample": 2' in values["settings"].tensor.string_val[0]
    assert any(name.endswith("/fitness") for name in values)
    pictures = [value for name, value in values.items() if name.startswith("films/")]
    assert pictures and any(b"GIF89a" in value.SerializeToString() for value in pictures)


def test_a_record_that_a_kill_tore_hides_nothing_that_a_resumed_run_tells(tmp_path: Path):
    for step in range(3):
        board = tensorboard.TensorBoard(tmp_path, RunConfig(env="toy"))
        board.numbers({f"of process {step}": 1.0}, step)
        board.close()
        if step == 0:
            (tmp_path / tensorboard.EVENTS).write_bytes((tmp_path / tensorboard.EVENTS).read_bytes()[:-5])
    told: list[str] = []
    for file in sorted(tmp_path.iterdir()):
        with suppress(DataLossError):
            told += [value.tag for event in EventFileLoader(str(file)).Load() for value in event.summary.value]
    assert told[-2:] == ["of process 1", "of process 2"] and told.count("settings") <= 1


def test_a_tracker_that_fails_ends_its_mirror_and_not_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    fake = FakeWandb()
    fake.log = lambda values: 1 / 0  # type: ignore[method-assign]
    monkeypatch.setitem(sys.modules, "wandb", fake)
    mirror(tmp_path / "run", "wandb")
    assert capsys.readouterr().out == "log=wandb stopped recording this run: division by zero\n"
    assert [kind for kind, _ in fake.calls] == ["init", "finish"], "it is closed, so the next run begins a new one"


@pytest.mark.parametrize("log", ["wandb", "mlflow"])
def test_a_tracker_that_cannot_open_says_so_before_anything_trains(
    log: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setitem(sys.modules, log, ModuleType(log))
    with trackers.mirrored(tmp_path, RunConfig(env="toy", log=log)) as (told,):
        told(Began("train"))
        said = capsys.readouterr().out
        assert said.startswith(f"log={log} cannot record this run") and f"module '{log}' has no attribute" in said
        assert ("MLFLOW_TRACKING_URI must name a server" in said) == (log == "mlflow")
        told._tell("numbers", {"x": 1.0}, 0)
    assert capsys.readouterr().out == ""


def test_wandb_goes_on_with_the_run_that_it_says_it_began(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    fake = FakeWandb()
    fake.id = "of a notebook"
    monkeypatch.setitem(sys.modules, "wandb", fake)
    trackers.Wandb(tmp_path, RunConfig(env="toy"))
    assert "of a notebook" in (tmp_path / trackers.MEMORY).read_text()


@pytest.mark.parametrize("name", ["wandb", "mlflow"])
def test_a_tracker_that_is_not_installed_is_named_before_the_run_begins(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(ConfigError, match=f"pip install 'openeureka\\[{name}\\]'"):
        mirror(tmp_path / "run", name)
    assert not (tmp_path / "run").exists()


def test_nothing_is_imported_unasked(tmp_path: Path):
    mirror(tmp_path / "run", "")
    assert not {"wandb", "mlflow"} & set(sys.modules)
    assert not (tmp_path / "run" / trackers.MEMORY).exists()
