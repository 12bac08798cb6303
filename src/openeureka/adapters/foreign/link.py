"""An environment in another Python, with the methods of Gymnasium's vector environments: this side of `server.py`."""

from __future__ import annotations

import mmap
import os
import weakref
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from ...codec import DecodeError, convert
from ...errors import TaskError, WorkerError
from ...worker import Frame, Stranger, WorkerDied, WorkerTimeout

SERVER = Path(__file__).with_name("server.py")
VERSION = 1
"""Version of the frames; `server.py` has the same."""
STARTING, BEGINNING, STEPPING = 60.0, 480.0, 240.0
"""[s] that the other Python may take to start, to make an environment, and to step or reset it. Starting plus making,
and stepping plus resetting, take less than the silence after which the executor gives a worker up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Acting:
    """What a policy may do: numbers between bounds, or choices."""

    low: tuple[float | None, ...] = ()
    high: tuple[float | None, ...] = ()
    """In `low` and `high`, None is no bound."""
    whole: bool = False
    """Whether actions are rounded to whole numbers."""
    choices: tuple[int, ...] = ()
    """How many options each choice has."""
    starts: tuple[int, ...] = ()
    """Number of the first option of each choice."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Description:
    """What the other side says of an environment."""

    document: str
    actions: Acting
    steps: int
    dt: float
    """[s] between two actions."""
    timed: bool
    """Whether the environment itself says `dt`."""
    observation: tuple[tuple[str, tuple[int, ...], tuple[int, ...], tuple[int, ...]], ...]
    """Name and shape of each array; in an array of choices, also how many options each has, and the number of the first
    option. A single array may have no name."""
    state: tuple[tuple[str, tuple[int, ...], str], ...]
    """Name, shape and meaning of what else the environment tells in each step."""
    seeded: bool
    """Whether an episode follows from its seed and its actions, whatever other worlds do."""
    taken: tuple[str, ...]
    """Those of the offered settings that are parameters of the environment's factory."""
    layout: Mapping[str, tuple[int, str, tuple[int, ...]]]
    """Where each array lies in the mapped memory, its type and its shape."""


class Link:
    """N worlds of one environment, in a process of another Python.

    Args:
        env: the whole name, for sentences.
        kind, name: the suite, and what it calls the environment.
        python: the interpreter.
        settings: for the environment's factory.
        offered: also for the factory, as far as they are parameters of it.
        threads: that libraries there may use; 0 for as many as they like.

    Raises:
        TaskError: when that Python or the environment cannot be started; in any call, when the environment raises.
        WorkerError: in any call, when the process has died or does not answer.
    """

    def __init__(
        self,
        env: str,
        kind: str,
        name: str,
        *,
        python: str,
        settings: Mapping[str, Any],
        worlds: int,
        offered: Mapping[str, Any] = MappingProxyType({}),
        threads: int = 0,
    ) -> None:
        self._env, self._python = env, python
        descriptor = os.memfd_create("openeureka")
        try:
            self._worker = self._started(descriptor, threads)
            weakref.finalize(self, self._worker.close)
            self._greeted()
            asked = {"do": "describe", "kind": kind, "name": name, "worlds": worlds}
            asked |= {"settings": dict(settings), "offered": dict(offered)}
            self.about = self._description(self._asked(asked, BEGINNING))
            self._memory = mmap.mmap(descriptor, os.fstat(descriptor).st_size)
        finally:
            os.close(descriptor)
        self._arrays = {
            name: np.frombuffer(self._memory, kind, int(np.prod(shape, dtype=int)), start).reshape(shape)
            for name, (start, kind, shape) in self.about.layout.items()
        }

    def step(self, actions: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, np.ndarray]]:
        """Observation, reward, terminated, truncated and state, as views of the mapped memory."""
        self._arrays["actions"][:] = actions.reshape(self._arrays["actions"].shape)
        self._asked({"do": "step"}, STEPPING)
        arrays = self._arrays
        return self._seen(), arrays["reward"], arrays["terminated"], arrays["truncated"], self._state()

    def reset(self, *, seed: list[int], options: Mapping[str, np.ndarray]) -> tuple[Any, dict[str, np.ndarray]]:
        """Begin an episode in the worlds of `options["reset_mask"]` (N,); returns observation and state, as views."""
        self._arrays["mask"][:], self._arrays["seeds"][:] = options["reset_mask"], seed
        self._asked({"do": "reset"}, STEPPING)
        return self._seen(), self._state()

    def picture(self) -> np.ndarray | None:
        """(H, W, 3) uint8 of the first world; None where the environment draws nothing."""
        answer = self._asked({"do": "picture"}, STEPPING)
        shape = tuple(answer.header["shape"])
        return np.frombuffer(answer.blobs["picture"], np.uint8).reshape(shape) if shape else None

    def close(self) -> None:
        """End the process; safe to call twice."""
        self._worker.close()

    def _seen(self) -> Any:
        parts = {name: self._arrays[f"part {i}"] for i, (name, *_) in enumerate(self.about.observation)}
        return parts[""] if list(parts) == [""] else parts

    def _state(self) -> dict[str, np.ndarray]:
        return {name: self._arrays[f"state {name}"] for name, _, _ in self.about.state}

    def _started(self, descriptor: int, threads: int) -> Stranger:
        # A virtual environment finds itself; variables that name this process's one would mislead it.
        env = {key: value for key, value in os.environ.items() if key not in ("PYTHONHOME", "VIRTUAL_ENV")}
        try:
            return Stranger(
                self._python,
                SERVER,
                shared=descriptor,
                env=env | ({"OMP_NUM_THREADS": str(threads)} if threads else {}),
            )
        except WorkerDied as error:
            raise TaskError(f"{error} Set python=PATH to the Python that `{self._env}` is installed in.") from None

    def _greeted(self) -> None:
        try:
            hello = self._worker.receive(STARTING).header
        except WorkerTimeout:
            raise TaskError(f"{self._python} did not start within {STARTING:.0f} s.") from None
        except WorkerDied:
            said = self._worker.last_words() or "it printed nothing"
            raise TaskError(f"{self._python} cannot run the environment server: {said.rstrip('.')}.") from None
        if hello.get("version") != VERSION:
            raise TaskError(
                f"The environment server in {self._python} is version {hello.get('version')}, but version {VERSION} is "
                "needed: use the server file of this openeureka."
            )

    def _description(self, answer: Frame) -> Description:
        try:
            return convert(Description, answer.header)
        except DecodeError as error:
            raise TaskError(f"The description that `{self._env}` gives of itself is not valid: {error}.") from None

    def _asked(self, question: Mapping[str, Any], patience: float) -> Frame:
        doing = {"describe": "making", "step": "stepping", "reset": "resetting", "picture": "drawing"}[question["do"]]
        try:
            self._worker.send(question)
            answer = self._worker.receive(patience)
        except WorkerTimeout:
            self._worker.close()
            raise WorkerError(f"{self._python} did not finish {doing} `{self._env}` in {patience:g} s.") from None
        except WorkerDied:
            parts = (self._worker.ending(), self._worker.last_words())
            self._worker.close()
            said = " ".join(filter(None, parts))
            raise WorkerError(f"{self._python} ended while {doing} `{self._env}`. {said}".rstrip()) from None
        if "broken" in answer.header:
            failed = "cannot be made" if question["do"] == "describe" else "failed"
            said = answer.header["broken"]
            lacking = f" {self._python} lacks it: install it there, or set python= to the interpreter that has it."
            raise TaskError(f"The environment `{self._env}` {failed}: {said}.{lacking if 'No module' in said else ''}")
        return answer
