"""Any vector environment, as `server.py` steps it, in the Python it is installed in: `env=python:FILE.py:NAME`."""

from __future__ import annotations

import difflib
import functools
import importlib
import importlib.util
import inspect
import os
import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

_LONGEST = 1000
_STEPS = ("max_episode_length", "max_episode_steps", "episode_length")


class Vector:
    """What a factory makes: it has the methods of Gymnasium's vector environments, and resets only when told to. A list
    of single environments will do.

    `step(actions)` gives observation, reward, terminated, truncated and info; `reset(seed=, options=)` with
    `options["reset_mask"]` gives observation and info. Observations are an array (N, ...), or a dict or tuple of them.
    The numbers in `info`, and in what the method `state()` gives if there is one, are state variables.
    """

    seeded = True

    def __init__(self, name: str, worlds: int, settings: dict[str, Any]) -> None:
        env = made(name)(worlds, **settings)
        self.env: Any = Each(env) if isinstance(env, list) else env
        self.worlds, self.begun = worlds, False
        mode = (getattr(self.env, "metadata", None) or {}).get("autoreset_mode")
        old = mode is None and type(self.env).__module__.startswith("gymnasium.vector.")  # before Gymnasium 1.1
        if old or (mode is not None and "disabled" not in str(mode).lower()):
            raise ValueError(
                "it resets itself; make it with autoreset_mode=AutoresetMode.DISABLED, or return a list of environments"
            )

    def about(self) -> dict[str, Any]:
        env, inner = self.env, _inner(self.env)
        told = getattr(env, "document", None)
        document = told if told is not None else inspect.getdoc(type(inner)) or ""
        space = getattr(env, "single_action_space", None) or getattr(env, "action_space", None)
        actions = _actions(space, env)
        self.shape, kind = tuple(actions.pop("shape")), getattr(space, "dtype", None)
        self.kind = kind if isinstance(kind, np.dtype) else None
        limited = [getattr(owner, "spec", None) for owner in (env, *(getattr(env, "envs", None) or ())[:1], inner)]
        steps = [getattr(spec, "max_episode_steps", None) for spec in limited]
        steps += [getattr(env, name, None) for name in _STEPS]
        rate = (getattr(env, "metadata", None) or {}).get("render_fps")
        times = [
            getattr(owner, name, None) for owner in (env, inner) for name in ("step_dt", "control_dt", "dt", "tau")
        ]
        return {
            "document": document,
            "actions": actions,
            "steps": next((int(n) for n in steps if n), _LONGEST),
            "dt": next((float(t) for t in [*times, 1.0 / rate if rate else None] if t), 1.0),
            "timed": any(times),
            "meanings": dict(getattr(env, "meanings", {})),
            "counted": dict(_counted(getattr(env, "single_observation_space", None))),
        }

    def reset(self, mask: np.ndarray, seeds: np.ndarray) -> tuple[Any, ...]:
        try:
            observation, info = self.env.reset(seed=seeds.tolist(), options={"reset_mask": mask.copy()})
        except Exception as error:
            if self.begun or not hasattr(self.env, "unwrapped") or hasattr(self.env.unwrapped, "num_envs"):
                raise
            raise ValueError(
                "it is a single environment; return a list of `worlds` of them, or use env=gym:ID"
            ) from error
        self.begun = True
        return self._parts(observation), self._state(info)

    def step(self, actions: np.ndarray) -> tuple[Any, ...]:
        actions = actions.reshape((self.worlds, *self.shape))
        if self.kind is not None:
            actions = (np.rint(actions) if self.kind.kind in "iu" else actions).astype(self.kind)
        if "torch" in sys.modules and getattr(self.env, "device", None) is not None:
            actions = sys.modules["torch"].as_tensor(actions, device=self.env.device)
        observation, reward, terminated, truncated, info = self.env.step(actions)
        return self._parts(observation), reward, terminated, truncated, self._state(info)

    def picture(self) -> Any:
        drawn: Any = self.env.render() if getattr(self.env, "render_mode", None) == "rgb_array" else None
        return drawn[0] if isinstance(drawn, (tuple, list)) and drawn else drawn

    def _parts(self, observation: Any, path: tuple[str, ...] = ()) -> dict[str, Any]:
        inner = _inside(observation)
        if inner is None:
            return {" ".join(path): observation}
        found = {}
        for key, value in inner:
            found.update(self._parts(value, (*path, key)))
        return found

    def _state(self, info: Any) -> dict[str, Any]:
        told = dict(info) if isinstance(info, dict) else {}
        told.update(self.env.state() if callable(getattr(self.env, "state", None)) else {})
        return told


class Each:
    """Single environments of Gymnasium's, of any version, stepped in turn: none resets itself."""

    def __init__(self, envs: list[Any]) -> None:
        self.envs, (first, *_) = envs, envs
        self.spec, self.metadata, self.render, self.render_mode = (
            getattr(first, name, None) for name in ("spec", "metadata", "render", "render_mode")
        )
        self.single_action_space, self.single_observation_space = first.action_space, first.observation_space
        self._seen: list[Any] = [None] * len(envs)
        self._told: list[Any] = [None] * len(envs)

    def reset(self, seed: list[int], options: dict[str, Any]) -> tuple[Any, ...]:
        for world in np.flatnonzero(options["reset_mask"]):
            self._seen[world], self._told[world] = self.envs[world].reset(seed=seed[world])
        return _stacked(self._seen), _shared(self._told)

    def step(self, actions: np.ndarray) -> tuple[Any, ...]:
        steps = [env.step(actions[world]) for world, env in enumerate(self.envs)]
        self._seen, self._told = [step[0] for step in steps], [step[4] for step in steps]
        rewards, terminated, truncated = (np.array([step[part] for step in steps]) for part in (1, 2, 3))
        return _stacked(self._seen), rewards, terminated, truncated, _shared(self._told)


def _stacked(values: Sequence[Any]) -> Any:
    """Observations of several environments as one, with a row for each."""
    first = _inside(values[0])
    if first is None:
        return np.stack([np.asarray(value) for value in values])
    return {key: _stacked([dict(_inside(value) or ())[key] for value in values]) for key, _ in first}


def _shared(infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The numbers that every `info` has, always in the same shape."""
    kinds = (bool, int, float, np.generic, np.ndarray)
    told: dict[str, list[Any]] = {name: [info.get(name) for info in infos] for name in infos[0]}
    return {
        name: np.array(values)
        for name, values in told.items()
        if all(isinstance(value, kinds) for value in values) and len({np.shape(value) for value in values}) == 1
    }


def _inside(value: Any) -> list[tuple[str, Any]] | None:
    """The entries of a dict or a tuple, by name; None for anything else."""
    if isinstance(value, tuple):
        value = dict(enumerate(value))
    return [(str(key), held) for key, held in value.items()] if isinstance(value, dict) else None


def _counted(space: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, tuple[list[int], list[int]]]]:
    """For each array of choices, by name: how many options each choice has, and the number of the first option."""
    inner = _inside(getattr(space, "spaces", None))
    if inner is not None:
        for key, held in inner:
            yield from _counted(held, (*path, key))
    elif hasattr(space, "nvec") or (hasattr(space, "n") and not hasattr(space, "low") and not space.shape):
        told = _actions(space, None)
        yield " ".join(path), (told["choices"], told["starts"])


def _inner(env: Any) -> Any:
    envs = getattr(env, "envs", None)
    return getattr(envs[0], "unwrapped", envs[0]) if envs else getattr(env, "unwrapped", env)


def _actions(space: Any, env: Any) -> dict[str, Any]:
    """What a policy may do, from a space of Gymnasium's or `num_actions`."""
    if hasattr(space, "nvec"):
        starts = np.broadcast_to(getattr(space, "start", 0), space.nvec.shape)
        choices = {"choices": space.nvec.reshape(-1).tolist(), "starts": starts.reshape(-1).tolist()}
        return {**choices, "shape": list(space.nvec.shape)}
    if hasattr(space, "n") and not hasattr(space, "low"):
        if space.shape:  # Gymnasium's MultiBinary: an array of bits
            count = int(np.prod(space.shape))
            return {"choices": [2] * count, "starts": [0] * count, "shape": list(space.shape)}
        return {"choices": [int(space.n)], "starts": [int(getattr(space, "start", 0))], "shape": []}
    if hasattr(space, "low"):
        low, high = (np.asarray(side, np.float64).reshape(-1) for side in (space.low, space.high))
        whole = getattr(getattr(space, "dtype", None), "kind", "f") in "iu"
        return {"low": low, "high": high, "whole": whole, "shape": list(space.shape)}
    count = int(getattr(env, "num_actions", 0))
    if not count:
        raise ValueError("it has neither `single_action_space` nor `num_actions`")
    return {"low": [-1.0] * count, "high": [1.0] * count, "shape": [count]}


def python(name: str, worlds: int, settings: dict[str, Any]) -> Vector:
    """The environment that `name` makes, with settings for its factory."""
    return Vector(name, worlds, settings)


def takes(name: str, setting: str) -> bool:
    """Whether the setting is a parameter of the environment's factory."""
    try:
        return setting in inspect.signature(made(name)).parameters
    except (TypeError, ValueError):  # it has no signature: functions written in C often have none
        return False


@functools.lru_cache(maxsize=None)  # noqa: UP033  not in Python 3.8. To import a file twice may register twice
def made(name: str) -> Any:
    """What `pkg.mod:factory` or `FILE.py:factory` names."""
    place, _, attribute = name.rpartition(":")
    if not place:
        raise ValueError("name the factory of the environment: pkg.mod:factory or FILE.py:factory")
    file = os.path.expanduser(place)
    if place.endswith(".py") and not os.path.isfile(file):
        raise ValueError(f"there is no file {place}")
    module = _module(file) if place.endswith(".py") else importlib.import_module(place)
    if not hasattr(module, attribute):
        close = difflib.get_close_matches(attribute, dir(module), n=1)
        raise ValueError(f"{place} has no `{attribute}`{f', perhaps `{close[0]}`' if close else ''}")
    return getattr(module, attribute)


def _module(file: str) -> Any:
    sys.path.insert(0, os.path.dirname(os.path.abspath(file)))  # as if Python were started with the file
    spec: Any = importlib.util.spec_from_file_location("openeureka_" + os.path.basename(file)[:-3], file)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module
