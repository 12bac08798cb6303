"""From `env=gym:ID` to a task."""

from __future__ import annotations

import functools
import importlib
import json
import warnings
from collections.abc import Mapping
from typing import Any

import gymnasium
from gymnasium import Env, error

from ...errors import TaskError, nearest
from ...tasks.faults import told
from .survey import survey
from .task import GymTask
from .task import task as task_of

AS_IT_IS = "gym-asis"
"""The prefix under which an environment steps itself although it could be lifted."""
_OWN = ("fitness",)


def imports(name: str, settings: Mapping[str, str]) -> bool:
    """Whether making it imports a module, or reads a file, of the name's own choice."""
    return ":" in name or bool(_keywords(settings))


def _keywords(settings: Mapping[str, str]) -> dict[str, str]:
    return {key: value for key, value in settings.items() if key not in _OWN and not hasattr(GymTask, key)}


def task(env: str, name: str, settings: Mapping[str, str]) -> tuple[type[GymTask], dict[str, str]]:
    """The class of a Gymnasium id, and those settings that are left to set of it.

    Args:
        env: the whole of what `env=` says.
        name: `ID` or `package:ID`.
        settings: `fitness`, what the environment's constructor takes, and class attributes.

    Raises:
        TaskError: when there is no such id, or the environment cannot be made or acted in.
    """
    left = {key: value for key, value in settings.items() if hasattr(GymTask, key) and key not in _OWN}
    keywords = {key: _value(text) for key, text in _keywords(settings).items()}
    steps = left.pop("episode_length", "")
    if steps:
        if not steps.isdigit() or int(steps) < 1:
            raise TaskError(f"`episode_length` of {name} is a number of steps, not `{steps}`.")
        keywords["max_episode_steps"] = int(steps)
    return _task(env, name, json.dumps(keywords), settings.get("fitness", "")), left


@functools.cache
def _task(env: str, name: str, keywords: str, fitness: str) -> type[GymTask]:
    make = functools.partial(_make, name, **json.loads(keywords))
    instance = make()
    try:
        found = survey(instance, name)
    except TaskError:
        raise
    except Exception as fault:
        raise TaskError(f"The environment `{name}` failed: {told(fault)}") from fault
    finally:
        instance.close()
    return task_of(env, found, make, fitness)


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def _make(name: str, **keywords: Any) -> Env[Any, Any]:
    """One instance, which can draw itself if it knows how. Raises TaskError, which says what to type instead."""
    package, _, bare = name.rpartition(":")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # old versions, bounds of spaces: nothing that a person asked about
        try:
            if package:
                importlib.import_module(package)
            spec = gymnasium.spec(bare)
            modes = _render_modes(spec)
            draws = {"render_mode": "rgb_array"} if "rgb_array" in modes else {}
            return gymnasium.make(bare, disable_env_checker=True, **draws, **keywords)
        except error.DependencyNotInstalled as fault:
            raise TaskError(f"{bare} needs a package that is not here ({_line(fault)}): pip install 'openeureka[gym]'.") from None
        except (error.UnregisteredEnv, error.DeprecatedEnv, error.Error) as fault:
            raise TaskError(f"Gymnasium has no `{bare}`.{_near(bare)}{_more(package, fault)}") from None
        except ModuleNotFoundError as fault:
            raise TaskError(f"`{name}` needs the module `{fault.name}`, which is not installed.") from None
        except Exception as fault:
            raise TaskError(f"The environment `{name}` cannot be made: {told(fault)}") from fault


def _render_modes(spec: Any) -> list[str]:
    entry = spec.entry_point
    made = gymnasium.envs.registration.load_env_creator(entry) if isinstance(entry, str) else entry
    return list((getattr(made, "metadata", None) or {}).get("render_modes", ()))


def _near(name: str) -> str:
    return nearest(name, gymnasium.registry)


def _more(package: str, fault: Exception) -> str:
    """What else may be wrong."""
    if isinstance(fault, error.DeprecatedEnv):
        return f" {_line(fault)}"
    return "" if package else " If a package registers it, name that first: gym:PACKAGE:ID."


def _line(fault: Exception) -> str:
    return " ".join(str(fault).split()).rstrip(".")
