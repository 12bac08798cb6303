"""Learning curves as TensorBoard event files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from io import BytesIO

# The classes of these two modules are made at import time, where no type checker sees them.
from tensorboard.compat.proto.event_pb2 import Event  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.compat.proto.summary_pb2 import Summary  # pyright: ignore[reportAttributeAccessIssue]
from tensorboard.summary.writer.record_writer import RecordWriter

from ..types import TrainingResult

FILE_NAME = "events.out.tfevents.0"
"""TensorBoard recognises event files by `tfevents` in their name."""


def encode(
    curves: Mapping[str, Sequence[float | None]],
    *,
    env_steps: int = 0,
    seconds: float = 0.0,
    clock: Sequence[float] = (),
) -> bytes:
    """One scalar per curve and epoch, over environment steps. Equal trainings give equal bytes: no host name goes in.

    Args:
        env_steps: of the whole training; 0 counts epochs instead.
        seconds: that the training took, from time 0; without a clock, epochs are taken to last equally long.
        clock: [s] at each epoch, waits between two processes left out.
    """
    epochs = max(map(len, curves.values()), default=0)
    buffer = BytesIO()
    writer = RecordWriter(buffer)
    writer.write(Event(file_version="brain.Event:2").SerializeToString())
    for tag, values in curves.items():
        for epoch, value in enumerate(values):
            if value is not None:
                summary = Summary(value=[Summary.Value(tag=tag, simple_value=value)])
                step = (epoch + 1) * env_steps // epochs if env_steps else epoch
                time = clock[epoch] if epoch < len(clock) else (epoch + 1) * seconds / epochs
                writer.write(Event(step=step, wall_time=time, summary=summary).SerializeToString())
    return buffer.getvalue()


def of(result: TrainingResult) -> bytes:
    """The event file of a training."""
    return encode(result.curves, env_steps=result.env_steps, seconds=result.seconds, clock=result.clock)
