"""From `env=PREFIX:NAME+python=PATH` to a task that steps in another Python."""

from __future__ import annotations

import functools
import json
import math
import re
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, cast

import numpy as np
import torch
from gymnasium import spaces
from torch import Tensor

from ...errors import TaskError
from ...parsing import literal
from ...types import RewardGraph, StateUse, StateVar
from ...worker import interpreter
from ..gym import documents
from ..gym.resolve import OURS, split_settings
from ..gym.spaces import Actions, Part, actions
from ..gym.survey import Survey
from ..gym.task import GymTask, attributes
from ..gym.worlds import GymWorlds
from .export import terms
from .link import Acting, Description, Link

_TRIED = 2
"""Worlds that are made for the description: with more than one, arrays with a row for each stand out."""


def imports(name: str, settings: Mapping[str, str]) -> bool:
    """True, always: another program runs."""
    return True


def task(env: str, name: str, settings: Mapping[str, str]) -> tuple[type[GymTask], dict[str, str]]:
    """The task class of an environment in another Python, and the settings that are left for its class attributes.

    Args:
        env: the whole value of `env=`.
        name: what comes after the prefix.
        settings: `python`, `fitness`, parameters of the environment's factory, and class attributes.

    Raises:
        TaskError: when that Python does not run, or the environment cannot be made.
        WorkerError: when it dies, or takes too long.
    """
    given, own = split_settings({key: value for key, value in settings.items() if key != "python"})
    offered = {key: literal(text) for key, text in own.items() if key not in OURS}
    python, fitness = settings.get("python", interpreter()[0]), settings.get("fitness", "")
    found = _task(env, env.partition(":")[0], name, python, json.dumps(given), json.dumps(offered), fitness)
    taken = found.opened.keywords["settings"]
    return found, {key: text for key, text in own.items() if key not in taken}


@functools.cache
def _task(env: str, kind: str, name: str, python: str, given: str, own: str, fitness: str) -> type[ForeignTask]:
    shown, offered = f"{kind}:{name}", json.loads(own)
    settings = json.loads(given)
    link = Link(shown, kind, name, python=python, settings=settings, offered=offered, worlds=_TRIED)
    link.close()
    settings |= {key: offered[key] for key in link.about.taken}
    opened = functools.partial(Link, shown, kind, name, python=python, settings=settings)
    found = surveyed(shown, link.about)
    said = {"__module__": __name__, **attributes(env, found, fitness)}
    said |= {"suite": kind, "opened": staticmethod(opened)}
    return cast(type[ForeignTask], type("ForeignTask", (ForeignTask,), said))


def surveyed(env: str, about: Description) -> Survey:
    """The description in the form that a task needs. Where a suite says what its state means, rewards read that state
    instead of columns of the observation."""
    parts = tuple(_part(*told) for told in about.observation)
    named = tuple(
        StateVar(name=name, shape=shape, meaning=meaning or f"{name.replace('_', ' ')}, as the environment has it",
                 use=_use(name, shape, meaning))
        for name, shape, meaning in about.state
    )  # fmt: skip
    return Survey(
        env=env,
        parts=parts,
        actions=_actions(about.actions, env),
        steps=about.steps,
        dt=about.dt,
        timed=about.timed,
        infos={name: shape for name, shape, _ in about.state},
        sections={},
        document=about.document,
        named=named if any(meaning for _, _, meaning in about.state) else (),
    )


def _part(name: str, shape: tuple[int, ...], counts: tuple[int, ...], starts: tuple[int, ...]) -> Part:
    path = (name,) if name else ()
    if counts:
        return Part(path, "MultiDiscrete" if shape else "Discrete", (sum(counts),), counts, starts)
    return Part(path, "Box", shape or (1,))


def _use(name: str, shape: tuple[int, ...], meaning: str) -> StateUse:
    if len(shape) > 1 or re.search(r"quat", name):
        return "raw"
    return "point" if shape == (3,) and re.search(r"\bposition\b", meaning) else documents.use_of(f"{name} {meaning}")


def _actions(told: Acting, env: str) -> Actions:
    if len(told.choices) > 1:
        return actions(spaces.MultiDiscrete(np.array(told.choices), start=np.array(told.starts)), env)
    if told.choices:
        return actions(spaces.Discrete(told.choices[0], start=told.starts[0]), env)
    low, high = (
        np.array([side * math.inf if value is None else value for value in values], np.float64)
        for side, values in ((-1, told.low), (1, told.high))
    )
    kind = np.int64 if told.whole and np.isfinite([low, high]).all() else np.float64
    return actions(spaces.Box(low.astype(kind), high.astype(kind), dtype=kind), env)


class ForeignWorlds(GymWorlds):
    """Worlds that another process steps.

    Where all worlds share one generator, an episode does not follow from its seed. Then nothing is remembered, and a
    training that goes on from a saved state begins new episodes.
    """

    _vector: Link
    _anew = False
    """Whether the next step begins new episodes."""

    def _opened(self, make: Callable[..., Link], num_worlds: int) -> Link:
        return make(worlds=num_worlds)

    def step(self, substeps: int) -> None:
        super().step(substeps)
        if self._anew:  # the saved episodes are lost: marked as bad, these count for nothing and begin again
            self.bad[:], self._anew = True, False

    def picture(self, world: int) -> np.ndarray | None:
        return self._vector.picture() if world == 0 else None

    def memory(self) -> dict[str, Tensor]:
        return super().memory() if self._vector.about.seeded else {"observation": self.observation}

    def load_state_dict(self, saved: Mapping[str, Tensor]) -> None:
        if self._vector.about.seeded:
            super().load_state_dict(saved)
            return
        self.forward(torch.arange(self.num_worlds))
        self._anew = True

    def _keep(self, each: Tensor) -> None:
        if self._vector.about.seeded:
            super()._keep(each)

    def _replay(self, taken: Tensor, steps: Tensor) -> None:
        """Replay all worlds at once, so that they end together: those with shorter episodes begin later."""
        longest, each = int(steps.max()), torch.arange(self.num_worlds)
        waits = longest - steps
        for number in range(longest):
            self._begin(waits == number if number else torch.zeros_like(waits, dtype=torch.bool))
            action = torch.where((waits <= number)[:, None], taken[each, (number - waits).clamp(min=0)], 0.0)
            *_, terminated, truncated, _ = self._vector.step(self._actions.taken(action))
            self._begin((waits > number) & torch.from_numpy(terminated | truncated))
            self._replayed()
        self._begin(waits == longest)

    def _begin(self, worlds: Tensor) -> None:
        if bool(worlds.any()):
            self._vector.reset(seed=self.seeds.tolist(), options={"reset_mask": worlds.numpy()})


class ForeignTask(GymTask):
    """An environment that another Python steps."""

    opened: ClassVar[Any]
    """A static function of `worlds` and `threads` that starts the other process."""

    @classmethod
    def handed_back(cls, graph: RewardGraph, program: str) -> str:
        return terms(cls.survey.env, cls.suite, cls.spec, graph, program)

    @classmethod
    def simulate(cls, num_worlds: int, device: str, threads: int) -> ForeignWorlds:
        """Raises TaskError for any device but the CPU: what the other Python simulates on is its own setting."""
        if device != "cpu":
            raise TaskError(
                f"`{cls.env}` steps in its own Python; leave device={device} out, and write env={cls.env}+device=..."
            )
        make = functools.partial(cls.opened, threads=threads)
        return ForeignWorlds(make, num_worlds, cls.survey, name=cls.env, episode=cls.episode_length)
