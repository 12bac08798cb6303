"""Learning curves as TensorBoard event files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO

# The classes of these two modules are made at import time, where no type checker sees them.
from tensorboard.compat.proto.event_pb2 import Event  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.compat.proto.summary_pb2 import Summary  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.summary.writer.record_writer import RecordWriter

FILE_NAME = "events.out.tfevents.0"
"""TensorBoard recognises event files by `tfevents` in their name."""


def encode(curves: Mapping[str, Sequence[float | None]]) -> bytes:
    """One scalar per curve and epoch. Equal curves give equal bytes: no clock and no host name goes in."""
    buffer = BytesIO()
    writer = RecordWriter(buffer)
    writer.write(Event(file_version="brain.Event:2").SerializeToString())
    for tag, values in curves.items():
        for step, value in enumerate(values):
            if value is not None:
                summary = Summary(value=[Summary.Value(tag=tag, simple_value=value)])
                writer.write(Event(step=step, summary=summary).SerializeToString())
    return buffer.getvalue()
