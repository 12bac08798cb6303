"""Policies at work in 3-D on the page: each has a child process, which lives as long as somebody looks."""

from __future__ import annotations

import asyncio
import base64
import json
import math
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from typing import Any

from ..errors import ConfigError
from ..worker import Frame, Worker, WorkerDied, WorkerTimeout

MOST = 2
"""Most policies that play at a time; a further one ends the oldest."""
RATE = 30.0
"""Pictures per second [1/s]."""
PATIENCE = 60.0
"""[s] to wait for a world to be built, and for each of its pictures."""
_BOUNDS = {"speed": (0.0, 10.0), "angle": (-2 * math.pi, 2 * math.pi), "mass": (0.1, 10.0), "friction": (0.0, 10.0)}
_WORDS = {"push": ("speed", "angle"), "scale": ("mass", "friction"), "restart": ()}


class Players:
    """The child processes that play policies, by run and candidate."""

    def __init__(self) -> None:
        self._playing: dict[str, Worker] = {}

    def tell(self, key: str, form: Mapping[str, str]) -> bool:
        """Pass a person's wish on to the child; False where none plays. Raises ConfigError for an invalid wish."""
        wish = _wish(form)
        player = self._playing.get(key)
        if player is None:
            return False
        try:
            player.send(wish)
        except WorkerDied:
            return False
        return True

    async def events(
        self, key: str, env: str, policy: bytes, gone: Callable[[], Awaitable[bool]]
    ) -> AsyncIterator[str]:
        """Server-sent events: one `scene`, then a `frame` for each picture, or `end` with a sentence.

        Args:
            gone: whether nobody looks any more.
        """
        if key in self._playing:
            self._playing.pop(key).close()
        for oldest in list(self._playing)[: max(0, len(self._playing) + 1 - MOST)]:
            self._playing.pop(oldest).close()
        with Worker("openeureka.film.live") as player:
            self._playing[key] = player
            try:
                # In a thread: a pipe holds less than most policies, and the child reads it only after it has imported
                # MuJoCo.
                await asyncio.to_thread(player.send, {"env": env}, {"policy": policy})
                scene = await _answer(player)
                yield _event("scene", {**scene.header, **{name: _text(blob) for name, blob in scene.blobs.items()}})
                while not await gone():
                    due = time.monotonic() + 1.0 / RATE
                    player.send({"do": "frame"})
                    yield _event("frame", _text((await _answer(player)).blobs["frame"]))
                    await asyncio.sleep(max(0.0, due - time.monotonic()))
            except _Refused as refused:
                yield _event("end", str(refused))
            except (WorkerDied, WorkerTimeout, ValueError):  # ValueError: closed because another one began
                ours = self._playing.get(key) is player
                why = player.ending() or "Its process ended, or took too long." if ours else "Another one was started."
                yield _event("end", f"The policy has stopped. {why}")
            finally:
                if self._playing.get(key) is player:
                    del self._playing[key]


class _Refused(Exception):
    """The child's reason why it cannot play."""


async def _answer(player: Worker) -> Frame:
    frame = await asyncio.to_thread(player.receive, PATIENCE)
    if "refused" in frame.header:
        raise _Refused(frame.header["refused"])
    return frame


def _wish(form: Mapping[str, str]) -> dict[str, Any]:
    """What a form asks of a world, with numbers inside their bounds."""
    kind = form.get("do", "")
    if kind not in _WORDS:
        raise ConfigError("`do` must be push, scale or restart.")
    wish: dict[str, Any] = {"do": kind}
    for name in _WORDS[kind]:
        low, high = _BOUNDS[name]
        try:
            wish[name] = float(form.get(name, ""))
        except ValueError:
            wish[name] = math.nan
        if not low <= wish[name] <= high:
            raise ConfigError(f"`{name}` must be a number from {low:g} to {high:g}.")
    return wish


def _event(name: str, data: object) -> str:
    return f"event: {name}\ndata: {json.dumps(data)}\n\n"


def _text(blob: bytes) -> str:
    return base64.b64encode(blob).decode()
