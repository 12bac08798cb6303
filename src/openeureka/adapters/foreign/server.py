"""Steps an environment for openeureka in the Python it is installed in: runs there as a file, and needs only NumPy.

It exchanges the frames of `worker.py` over two pipes, so what an environment prints is not among them. Its arguments
are the descriptors of these pipes and of memory that both sides map. Requests: `describe` comes first, makes the
environment and says what it is; `reset` and `step` leave their results in the mapped memory; `picture`. The answer to a
fault is a frame with `broken`.

Nothing of openeureka is imported, and the syntax is that of Python 3.8. What a suite needs is in a separate file of
this folder, which is loaded for this suite only.
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import mmap
import os
import signal
import struct
import sys
import traceback
import warnings
from typing import Any

import numpy as np

VERSION = 1
"""Version of what the frames say; the other side refuses any other."""
_PREFIX = struct.Struct("<IQ")
_SUITES = {
    "python": "vector.py",
    "mjlab": "scene.py",
    "isaaclab": "scene.py",
    "dmc": "dmc.py",
    "maniskill": "maniskill.py",
}
"""Suite -> file. Its function of the suite's name makes an environment."""
_HERE = os.path.dirname(os.path.abspath(__file__))


class Channel:
    """Frames as `openeureka.worker` writes them."""

    def __init__(self, incoming: int, outgoing: int) -> None:
        self._in, self._out = os.fdopen(incoming, "rb"), os.fdopen(outgoing, "wb")

    def receive(self) -> dict[str, Any] | None:
        """The next request; None when the other side is gone."""
        prefix = self._in.read(_PREFIX.size)
        if len(prefix) < _PREFIX.size:
            return None
        return json.loads(self._in.read(_PREFIX.unpack(prefix)[0]))["header"]

    def send(self, header: dict[str, Any], blobs: dict[str, bytes] | None = None) -> None:
        blobs = blobs or {}
        head = json.dumps({"header": header, "blobs": {name: len(blob) for name, blob in blobs.items()}}).encode()
        self._out.write(b"".join((_PREFIX.pack(len(head), sum(map(len, blobs.values()))), head, *blobs.values())))
        self._out.flush()


def numbers(value: Any) -> np.ndarray:
    """A tensor of any library, on any device, as an array."""
    value = getattr(value, "torch", value)  # Isaac Lab 3 wraps tensors
    if hasattr(value, "detach"):
        value = value.detach().cpu()
    return np.asarray(value)


def _module(file: str) -> Any:
    spec: Any = importlib.util.spec_from_file_location("openeureka_" + os.path.basename(file)[:-3], file)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def _numeric(state: dict[Any, Any], worlds: int) -> dict[str, Any]:
    """The entries that hold numbers for each world, under names that a reward can use."""
    return {
        name: value
        for name, value in state.items()
        if isinstance(name, str) and name.isidentifier() and name[0] != "_" and _is_numeric(value, worlds)
    }


def _is_numeric(value: Any, worlds: int) -> bool:
    if isinstance(value, (str, bytes, dict, list, tuple, type(None))) or callable(value):
        return False
    array = numbers(value)
    return array.dtype.kind in "biuf" and array.ndim >= 1 and len(array) == worlds


def _bounds(side: Any) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in side]


class Memory:
    """Arrays that both sides see, by name."""

    def __init__(self, descriptor: int, shapes: dict[str, tuple[str, tuple[int, ...]]]) -> None:
        self.layout, size = {}, 0
        for name, (kind, shape) in shapes.items():
            self.layout[name] = [size, kind, [int(n) for n in shape]]
            size += -(-int(np.prod(shape, dtype=np.int64)) * np.dtype(kind).itemsize // 64) * 64
        os.ftruncate(descriptor, max(size, 1))
        self._map = mmap.mmap(descriptor, max(size, 1))
        self.arrays = {
            name: np.frombuffer(self._map, kind, int(np.prod(shape, dtype=np.int64)), start).reshape(shape)
            for name, (start, kind, shape) in self.layout.items()
        }

    def write(
        self,
        parts: dict[str, Any],
        reward: Any,
        terminated: Any,
        truncated: Any,
        state: dict[str, Any],
        *,
        each: bool = False,
    ) -> None:
        """With `each`, raises ValueError where there is not a value for each world: NumPy would repeat a single one."""
        for number, value in enumerate(parts.values()):
            place = self.arrays[f"part {number}"]
            place[...] = numbers(value).reshape(place.shape)
        for name, value in (("reward", reward), ("terminated", terminated), ("truncated", truncated)):
            self._put(name, numbers(value), each=each)
        state = _numeric(state, len(self.arrays["reward"]))
        for name in (name for name in self.arrays if name.startswith("state ")):
            value = state.get(name[6:])
            if value is None:
                self.arrays[name][...] = 0.0
            else:
                self._put(name, numbers(value), each=each)

    def _put(self, name: str, value: np.ndarray, *, each: bool) -> None:
        place, flat = self.arrays[name], not name.startswith("state ")
        fits = value.size == place.size if flat else value.shape == place.shape
        if each and not fits:
            called = name if flat else name[6:]
            raise ValueError(
                f"`step` returns `{called}` of shape {value.shape}; {place.shape} is needed, one per world"
            )
        place[...] = value.reshape(-1) if flat else value


class Server:
    """One environment, and the requests to it."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def describe(
        self, kind: str, name: str, worlds: int, settings: dict[str, Any], offered: dict[str, Any]
    ) -> dict[str, Any]:
        """Makes the environment with the settings, and with those offered ones that are parameters of its factory."""
        suite = _module(os.path.join(_HERE, _SUITES[kind]))
        taken = [key for key in offered if hasattr(suite, "takes") and suite.takes(name, key)]
        settings = {**settings, **{key: offered[key] for key in taken}}
        self.env: Any = getattr(suite, kind)(name, worlds, settings)
        about = self.env.about()
        everywhere, seeds = np.ones(worlds, bool), np.arange(worlds)
        parts, state = self.env.reset(everywhere, seeds)
        for path, shape in ((path, numbers(part).shape) for path, part in parts.items()):
            if shape[:1] != (worlds,):
                called = f"`{path}` of its observation" if path else "its observation"
                raise ValueError(f"{called} has the shape {shape}; a row for each of {worlds} worlds is needed")
        state = _numeric(state, worlds)
        acting = about["actions"]
        choices = acting.get("choices")
        if choices:
            idle = np.zeros((worlds, len(choices)), np.int64) + acting["starts"]
        else:
            idle = np.zeros((worlds, len(acting["low"]))).clip(acting["low"], acting["high"]).astype(np.float32)
            acting.update({side: _bounds(acting[side]) for side in ("low", "high")})
        *_, later = self.env.step(idle)
        later = _numeric(later, worlds)
        shapes = {name: numbers(value).shape[1:] for name, value in {**later, **state}.items()}
        changing = {name for name in later if name in state and numbers(later[name]).shape[1:] != shapes[name]}
        shapes = {name: shape for name, shape in shapes.items() if name not in changing}
        wide = {"actions": ("<i8" if choices else "<f4", idle.shape), "seeds": ("<i8", (worlds,))}
        wide.update({name: ("|b1", (worlds,)) for name in ("mask", "terminated", "truncated")})
        wide["reward"] = ("<f4", (worlds,))
        wide.update({f"part {i}": ("<f4", numbers(part).shape) for i, part in enumerate(parts.values())})
        wide.update({f"state {name}": ("<f4", (worlds, *shape)) for name, shape in shapes.items()})
        self._memory = Memory(self._descriptor, wide)
        counted = about.get("counted", {})
        observed = [[n, list(numbers(part).shape[1:]), *counted.get(n, ([], []))] for n, part in parts.items()]
        listed = [[name, list(shape), about["meanings"].get(name, "")] for name, shape in shapes.items()]
        told = {key: value for key, value in about.items() if key not in ("meanings", "counted")}
        return {
            "timed": True,
            **told,
            "observation": observed,
            "state": listed,
            "seeded": self.env.seeded,
            "taken": taken,
            "layout": self._memory.layout,
        }

    def reset(self) -> dict[str, Any]:
        arrays = self._memory.arrays
        parts, state = self.env.reset(arrays["mask"], arrays["seeds"])
        self._memory.write(parts, 0.0, False, False, state)
        return {}

    def step(self) -> dict[str, Any]:
        # Copied: an environment may keep its actions, and the other side overwrites these with the next ones.
        self._memory.write(*self.env.step(self._memory.arrays["actions"].copy()), each=True)
        return {}


def guard() -> None:
    """Fork a process that waits for the end of this one, whatever ends it, and kills what the environment started."""
    server = os.getpid()
    if os.getpgrp() != server:  # not started by `worker.Stranger`
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # on a fork with threads: they are NumPy's, and the child needs none
        if os.fork():
            return
    os.closerange(0, 1 << 12)  # the other side must see the pipes end with the server
    signal.pthread_sigmask(signal.SIG_BLOCK, signal.valid_signals())
    ctypes.CDLL(None).prctl(1, signal.SIGUSR1)
    if os.getppid() == server:
        signal.sigwait({signal.SIGUSR1})
    os.killpg(server, signal.SIGKILL)


def main(incoming: int, outgoing: int, memory: int) -> None:
    os.dup2(2, 1)  # what is printed goes where errors go
    if sys.platform == "linux":
        guard()
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # dies with its parent, PR_SET_PDEATHSIG
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the other side's to handle
    # So is SIGTERM. Processes that an environment starts do not inherit this, and can be terminated.
    signal.signal(signal.SIGTERM, lambda *_: None)
    term = {signal.SIGTERM}  # blocked during a fork, until SIGTERM can end the child
    os.register_at_fork(
        before=lambda: signal.pthread_sigmask(signal.SIG_BLOCK, term),
        after_in_parent=lambda: signal.pthread_sigmask(signal.SIG_UNBLOCK, term),
        after_in_child=lambda: (
            signal.signal(signal.SIGTERM, signal.SIG_DFL),
            signal.pthread_sigmask(signal.SIG_UNBLOCK, term),
        ),
    )
    channel, server = Channel(incoming, outgoing), Server(memory)
    channel.send({"version": VERSION, "python": sys.version.split()[0]})
    while True:
        asked = channel.receive()
        if asked is None:
            return
        do, blobs = asked.pop("do"), {}
        try:
            if do == "picture":
                drawn = server.env.picture()
                answer = {"shape": []} if drawn is None else {"shape": list(drawn.shape)}
                blobs = {} if drawn is None else {"picture": np.ascontiguousarray(drawn, np.uint8).tobytes()}
            else:
                answer = getattr(server, do)(**asked)
        except BaseException as error:
            traceback.print_exc()
            answer = {"broken": told(error)}
        channel.send(answer, blobs)


def told(error: BaseException) -> str:
    """Kind, text and place of an error, on one line."""
    text = " ".join(str(error).split()).rstrip(".")
    frames = traceback.extract_tb(error.__traceback__)
    places = [frame for frame in frames if os.path.dirname(os.path.abspath(frame.filename)) != _HERE]
    where = f" ({os.path.basename(places[-1].filename)}, line {places[-1].lineno})" if places else ""
    return type(error).__name__ + (f": {text}" if text else "") + where


if __name__ == "__main__":
    main(*map(int, sys.argv[-3:]))
