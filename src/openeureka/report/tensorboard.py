"""Event files for TensorBoard: the curves of one training, and a tracker that follows a run."""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Mapping
from dataclasses import asdict
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

# The classes of these modules are made at import time, where no type checker sees them.
from tensorboard.compat.proto.event_pb2 import Event  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.compat.proto.summary_pb2 import Summary  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.compat.proto.tensor_pb2 import TensorProto  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.compat.proto.types_pb2 import DT_STRING  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.summary.writer.record_writer import RecordWriter

from ..config import RunConfig
from ..film import mp4
from ..store import artifacts
from ..types import TrainingResult

EVENTS = "events.out.tfevents.0"
"""The first event file. TensorBoard finds them by `tfevents` in their names, and reads them in the order of these."""


def _begun(file: BinaryIO) -> RecordWriter:
    """A writer of an event file, which is empty so far."""
    writer = RecordWriter(file)
    writer.write(Event(file_version="brain.Event:2").SerializeToString())
    return writer


def events_of(result: TrainingResult) -> bytes:
    """The event file of a training: one scalar per curve and epoch, over environment steps, or over epochs where no
    steps were counted. Times begin at 0 and no host name goes in, so equal trainings give equal bytes.

    Epochs without a stored time are taken to last equally long.
    """
    curves, first, clock = result.over_epochs, result.steps_before, result.clock
    epochs = max(map(len, curves.values()), default=0)
    buffer = BytesIO()
    writer = _begun(buffer)
    for tag, values in curves.items():
        for epoch, value in enumerate(values):
            if value is not None:
                summary = Summary(value=[Summary.Value(tag=tag, simple_value=value)])
                step = first + (epoch + 1) * (result.env_steps - first) // epochs if result.env_steps else epoch
                seconds = clock[epoch] if epoch < len(clock) else (epoch + 1) * result.seconds / epochs
                writer.write(Event(step=step, wall_time=seconds, summary=summary).SerializeToString())
    return buffer.getvalue()


class TensorBoard:
    """Events in the run directory, for `tensorboard --logdir DIR`. Films become animated GIFs.

    Each process begins a new file: a record that was cut off by a kill hides all that follows it in its file.
    """

    def __init__(self, directory: Path, config: RunConfig) -> None:
        names = itertools.chain([EVENTS], (f"{EVENTS}{number:04}" for number in itertools.count(1)))
        name = next(name for name in names if not artifacts.exists(directory, name))
        self._file = artifacts.appended(directory, name)
        self._writer = _begun(self._file)
        if name == EVENTS:
            self.text("settings", json.dumps(asdict(config), indent=1))

    def numbers(self, values: Mapping[str, float], step: int | None = None) -> None:
        self._write([Summary.Value(tag=name, simple_value=value) for name, value in values.items()], step or 0)

    def text(self, name: str, text: str) -> None:
        about = {"plugin_data": {"plugin_name": "text"}}
        block = "".join(f"    {line}\n" for line in text.splitlines())  # a code block in Markdown, shown as it is
        said = TensorProto(dtype=DT_STRING, string_val=[block.encode()], tensor_shape={"dim": [{"size": 1}]})
        self._write([Summary.Value(tag=name, tensor=said, metadata=about)], 0)

    def film(self, name: str, file: Path) -> None:
        picture, width, height = mp4.gif(file.read_bytes())
        image = Summary.Image(encoded_image_string=picture, width=width, height=height, colorspace=3)
        self._write([Summary.Value(tag=name, image=image)], 0)

    def _write(self, values: list[Any], step: int) -> None:
        event = Event(step=step, wall_time=time.time(), summary=Summary(value=values))
        self._writer.write(event.SerializeToString())
        self._file.flush()

    def close(self) -> None:
        self._file.close()
