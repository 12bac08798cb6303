"""From `env=gym:ID` to a task."""

from __future__ import annotations

import functools
import importlib.util
import inspect
import json
import re
import warnings
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, cast

import gymnasium
import mujoco
from gymnasium import Env, error
from gymnasium.envs.registration import load_env_creator
from gymnasium.wrappers import OrderEnforcing, PassiveEnvChecker, TimeLimit

from ...errors import TaskError, nearest
from ...parsing import literal
from ...tasks.faults import told_where
from ...tasks.task import Task
from .families import FAMILIES
from .formula import names
from .survey import Survey, survey
from .task import GymTask, PaidTask, attributes

AS_IT_IS = "gym-asis"
"""The prefix under which an environment steps itself although it could be lifted."""
OURS = ("fitness", "description")
"""Settings that no environment's constructor is given."""
_BARE = (TimeLimit, OrderEnforcing, PassiveEnvChecker)
"""Wrappers of `gymnasium.make`, which change neither what is paid nor what is seen."""


def imports(name: str, settings: Mapping[str, str]) -> bool:
    """Whether making the environment imports a module or reads a file that the name or the settings choose."""
    return ":" in name or not set(settings) <= {*OURS, "episode_length"}


def split_settings(
    settings: Mapping[str, str], parameters: Collection[str] = ()
) -> tuple[dict[str, Any], dict[str, str]]:
    """The settings for the environment's constructor, as values, and those for class attributes of the task.

    Args:
        parameters: of the constructor, which then do not count as attributes.
    """
    given: dict[str, Any] = {}
    own: dict[str, str] = {}
    for key, text in settings.items():
        attribute = key not in parameters and (hasattr(Task, key) or key in Task.__annotations__)
        if attribute or key in OURS:
            own[key] = text
        else:
            given[key] = literal(text)
    own.pop("fitness", None)
    return given, own


def task(env: str, name: str, settings: Mapping[str, str]) -> tuple[type[PaidTask], dict[str, str]]:
    """The task class of a Gymnasium id, and the settings that remain to be set on the class.

    Args:
        env: the whole of what `env=` says.
        name: `ID` or `package:ID`.
        settings: `fitness`, what the environment's constructor takes, and class attributes.

    Raises:
        TaskError: when there is no such id, or the environment cannot be made or acted in.
    """
    keywords, left = split_settings(settings)
    if not left.keys() <= {*OURS}:
        keywords, left = split_settings(settings, _parameters(name))
    steps = left.pop("episode_length", "")
    if steps:
        if not re.fullmatch(r"[1-9][0-9]{0,8}", steps):
            raise TaskError(f"`episode_length` of {name} is a number of steps, not `{steps:.40}`.")
        keywords["max_episode_steps"] = int(steps)
    return _task(env, name, json.dumps(keywords), settings.get("fitness", "")), left


@functools.cache
def _task(env: str, name: str, keywords: str, fitness: str) -> type[PaidTask]:
    make = functools.partial(_make, name, **json.loads(keywords))
    instance = make()
    try:
        found = survey(instance, name, names(fitness) if fitness else frozenset())
        lifted = {} if env.startswith(AS_IT_IS) else _lifted(instance, found)
    except TaskError:
        raise
    except (Exception, SystemExit) as fault:
        raise TaskError(f"The environment `{name}` failed: {told_where(fault)}") from fault
    finally:
        instance.close()
    said = {
        "__module__": __name__,
        **attributes(env, found, fitness),
        "make": staticmethod(make),
        "keywords": json.loads(keywords),
    }
    family = FAMILIES[type(instance.unwrapped).__name__] if lifted else GymTask
    return cast(type[PaidTask], type(family.__name__, (family,), {**said, **lifted}))


def _lifted(env: Env[Any, Any], found: Survey) -> dict[str, Any]:
    """What a lifted task takes from the instance. Empty for an environment that belongs to no family, has a wrapper
    beyond `_BARE` or does not fit its family's formulas: its reward, actions or observation may differ."""
    inner: Any = env
    while type(inner) in _BARE:
        inner = inner.env
    kind = type(inner)
    if kind.__name__ not in FAMILIES or not re.fullmatch(r"gymnasium\.envs\.mujoco\.\w+_v5", kind.__module__):
        return {}
    family = FAMILIES[kind.__name__]
    if not family.fits(inner):
        return {}
    # An Euler step leaves fields computed for the state that its last substep began with.
    lags = bool(family.fields) and inner.model.opt.integrator == mujoco.mjtIntegrator.mjINT_EULER
    return {
        "path": inner.fullpath,
        "substeps": inner.frame_skip,
        "constants": {name[1:]: value for name, value in vars(inner).items() if name[0] == "_"},
        "skipped": (getattr(inner, "observation_structure", None) or {}).get("skipped_qpos", 0),
        "recipe": family.recipe,
        "lags": lags,
        "memory": (*family.memory, "late") if lags else family.memory,
    }


def _make(name: str, /, **keywords: Any) -> Env[Any, Any]:
    """One instance, which can draw itself if it knows how. Raises TaskError, which says what to type instead."""
    package, _, bare = name.rpartition(":")
    if package.endswith(".py"):
        module = Path(package).stem
        raise TaskError(
            f"gym: takes a module, not a file: use gym:{module}:{bare}, and put the file's folder on PYTHONPATH."
        )
    if not bare:
        raise TaskError("Name an environment of Gymnasium after gym:, for example env=gym:CartPole-v1.")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # old versions, bounds of spaces: nothing that a person asked about
        try:
            if package:
                importlib.import_module(package)
            modes = (getattr(_maker(gymnasium.spec(bare)), "metadata", None) or {}).get("render_modes", ())
            make = functools.partial(gymnasium.make, bare, disable_env_checker=True, **keywords)
            try:
                return make(render_mode="rgb_array") if "rgb_array" in modes else make()
            except TypeError as fault:
                if "render_mode" not in str(fault):
                    raise
                return make()  # its class lists the mode, but its constructor does not take `render_mode`
        except error.DependencyNotInstalled as fault:
            raise TaskError(
                f"{bare} needs a package that is not installed ({_line(fault)}): pip install 'openeureka[gym]'."
            ) from None
        except error.Error as fault:
            if bare in gymnasium.registry:
                raise TaskError(f"The environment `{name}` cannot be made: {told_where(fault)}") from fault
            raise TaskError(f"Gymnasium has no `{bare}`.{_hints(package, bare, fault)}") from None
        except ModuleNotFoundError as fault:
            raise TaskError(f"`{name}` needs the module `{fault.name}`: {_importable(fault.name or '')}") from None
        except (Exception, SystemExit) as fault:
            said = _untaken(bare, keywords, fault) or _ungiven(bare, fault) or told_where(fault)
            raise TaskError(f"The environment `{name}` cannot be made: {said}") from fault


def _importable(module: str) -> str:
    """What to do about a module that is not found. A package may be installed under a name with `-`, which no module
    has."""
    called = module.replace("-", "_")
    if called != module and importlib.util.find_spec(called):
        return f"the installed one is called `{called}`, so write that."
    return "install it, or set PYTHONPATH to its folder."


def _parameters(name: str) -> Collection[str]:
    """Names of the constructor's parameters; none if it cannot be loaded, and `_make` says why."""
    package, _, bare = name.rpartition(":")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            if package:
                importlib.import_module(package)
            return inspect.signature(_maker(gymnasium.spec(bare))).parameters
        except (Exception, SystemExit):
            return ()


def _untaken(bare: str, keywords: Mapping[str, Any], fault: BaseException) -> str:
    """Names the setting that the constructor does not take, if that is the fault: Python's own message would name the
    constructor of a base class."""
    name = next((key for key in keywords if f"unexpected keyword argument '{key}'" in str(fault)), "")
    known = inspect.signature(_maker(gymnasium.spec(bare))).parameters if name else {}
    return f"it takes no `{name}`.{nearest(name, known)}" if name else ""


def _ungiven(bare: str, fault: BaseException) -> str:
    """Names the settings that the constructor lacks, if that is the fault."""
    lacks = re.search(r"missing \d+ required [\w-]+ arguments?: (.+?) was raised from", str(fault))
    lacking = re.findall(r"'(\w+)'", lacks[1]) if lacks else []
    if not lacking or not set(lacking) <= inspect.signature(_maker(gymnasium.spec(bare))).parameters.keys():
        return ""
    settings = "".join(f"+{name}=VALUE" for name in lacking)
    return f"add {settings}, or register it in a module of your own where the value is neither number nor text."


def _maker(spec: Any) -> Any:
    """The class or function of an environment."""
    entry = spec.entry_point
    return load_env_creator(entry) if isinstance(entry, str) else entry


def _hints(package: str, bare: str, fault: Exception) -> str:
    """What may be meant, and what else may be wrong."""
    tail = bare.rpartition("/")[2]
    same = [known for known in gymnasium.registry if known.rpartition("/")[2] == tail]
    near = nearest(same[0] if same else bare, gymnasium.registry)
    if isinstance(fault, error.DeprecatedEnv):
        return f"{near} {_line(fault)}"
    if not package:
        return f"{near} If a package registers it, name the package first: gym:PACKAGE:ID."
    return near or (
        f" Importing `{package}` does not register it: call what does in a module of your own, and name that module "
        "first: gym:MODULE:ID."
    )


def _line(fault: Exception) -> str:
    return " ".join(str(fault).split()).rstrip(".")
