"""Surveys an instance of an environment: its spaces, its episode, what `info` holds, its documentation."""

from __future__ import annotations

import builtins
import inspect
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from gymnasium import Env, ObservationWrapper

from ...errors import TaskError
from ...types import StateVar
from . import documents
from .spaces import Actions, Part, actions, parts

LONGEST = 1000
"""Longest episode, if the environment itself sets no limit [steps]."""
MAX_COLUMNS = 64
"""Most columns of an observation without documented names that each get a name."""
_LARGEST = float(np.finfo(np.float32).max)
_TRIED = 8
"""Random steps that are played to see what `info` holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """What a task needs to know of an environment."""

    env: str
    parts: tuple[Part, ...]
    actions: Actions
    steps: int
    """Steps after which an episode is cut off."""
    dt: float
    """[s] between two actions. Where nothing says how long, that of a video, or 1."""
    timed: bool
    """Whether the environment itself says `dt`."""
    infos: Mapping[str, tuple[int, ...]]
    """Numbers of `info`, with their shapes."""
    sections: Mapping[str, int]
    """Names and sizes of the parts of an observation that is one vector, where the environment tells them."""
    document: str
    named: tuple[StateVar, ...] = ()
    """State variables that the environment itself names, in place of columns of the observation; `infos` has each."""
    wanted: frozenset[str] = frozenset()
    """Names that F needs."""

    @property
    def size(self) -> int:
        """Numbers in an observation, O."""
        return sum(part.size for part in self.parts)


def survey(env: Env[Any, Any], name: str, wanted: frozenset[str] = frozenset()) -> Survey:
    """Plays a few random steps and, if they do not show all that is wanted, on to the end of an episode.

    Args:
        wanted: names that F needs.

    Raises:
        TaskError: for spaces that no policy here knows, for observations that are not finite, and for rewards that
            are arrays.
    """
    seen_as, acting = parts(env.observation_space, name), actions(env.action_space, name)
    observed, infos, paid = _play(env)
    if shape := next((np.shape(reward) for reward in paid if np.ndim(reward)), ()):
        raise TaskError(f"`{name}` pays an array of the shape {shape} in a step; wrap it so that it pays one number.")
    values = [part.of(seen) for seen in observed for part in seen_as]
    if not all(np.isfinite(value).all() for value in values):
        raise TaskError(f"`{name}` observes a value that is not finite, within {_TRIED} random steps.")
    if any((np.abs(value, dtype=np.float64) > _LARGEST).any() for value in values):
        raise TaskError(f"`{name}` observes a value beyond 3.4e38, the largest in 32 bits; wrap it to scale that down.")
    dt = _dt(env)
    spec, told = env.spec, _is_as_documented(env)
    found = Survey(
        env=name,
        parts=seen_as,
        actions=acting,
        steps=(spec.max_episode_steps if spec else None) or _own_limit(env) or LONGEST,
        dt=dt or _pace(env),
        timed=dt is not None,
        infos=_shapes(infos),
        sections=_structure(env) if told else {},
        wanted=wanted,
        document=(inspect.getdoc(type(env.unwrapped)) or "") if told else "",
    )
    unseen = wanted.difference(found.infos, (variable.name for variable, _ in variables(found)))
    if not unseen:
        return found
    # Anything else that only the end shows is left out: what rewards may read should not depend on F.
    late = {name: shape for name, shape in _shapes([*infos, *_play_on(env, found.steps)]).items() if name in unseen}
    return replace(found, infos={**found.infos, **late})


def _is_as_documented(env: Env[Any, Any]) -> bool:
    """Whether the environment observes what its class documents: neither a wrapper nor a subclass without a docstring
    changes the observation."""
    inner = env
    while inner is not env.unwrapped:
        if isinstance(inner, ObservationWrapper):
            return False
        inner = inner.env  # pyright: ignore[reportAttributeAccessIssue]
    own = vars(type(inner))
    inherited = not own.get("__doc__") and any(name in ("step", "reset") or "obs" in name for name in own)
    return not inherited and env.observation_space == inner.observation_space


def _structure(env: Env[Any, Any]) -> dict[str, int]:
    """Names and sizes of the parts of an observation, as Gymnasium's MuJoCo environments tell them."""
    told = getattr(env.unwrapped, "observation_structure", None)
    if not isinstance(told, dict):
        return {}
    return {name: int(size) for name, size in told.items() if not name.startswith("skipped")}


def _own_limit(env: Env[Any, Any]) -> int | None:
    """The limit `max_steps`, as environments that cut off episodes themselves tend to call it."""
    limit = getattr(env.unwrapped, "max_steps", None)
    return limit if isinstance(limit, int) and limit > 0 else None


def _dt(env: Env[Any, Any]) -> float | None:
    for name in ("dt", "tau"):
        value = getattr(env.unwrapped, name, None)
        if isinstance(value, int | float | np.number) and value > 0:
            return float(value)
    return None


def _pace(env: Env[Any, Any]) -> float:
    rate = env.metadata.get("render_fps")
    return 1.0 / rate if isinstance(rate, int | float) and rate > 0 else 1.0


def _play(env: Env[Any, Any]) -> tuple[list[Any], list[dict[str, Any]], list[Any]]:
    """Observations, `info` and rewards of a few random steps, and `info` of the start of one more episode."""
    env.action_space.seed(0)
    seen, info = env.reset(seed=0, options={})  # with options, as worlds are reset
    observed, infos, paid = [seen], [dict(info)], []
    for _ in range(_TRIED):
        seen, reward, terminated, truncated, info = env.step(env.action_space.sample())
        observed.append(seen)
        paid.append(reward)
        infos.append(dict(info))
        if terminated or truncated:
            env.reset(seed=0, options={})
    return observed, [*infos, env.reset(seed=1, options={})[1]], paid


def _play_on(env: Env[Any, Any], steps: int) -> list[dict[str, Any]]:
    """`info` of each random step of an episode, to its end or for `steps` steps."""
    infos: list[dict[str, Any]] = []
    env.reset(seed=1, options={})
    for _ in range(steps):
        _, _, terminated, truncated, info = env.step(env.action_space.sample())
        infos.append(dict(info))
        if terminated or truncated:
            break
    env.reset(seed=1, options={})
    return infos


def _shapes(infos: Iterable[Mapping[Any, Any]]) -> dict[str, tuple[int, ...]]:
    """Shapes of the entries of `info` that hold numbers, always in the same shape."""
    shapes: dict[str, set[tuple[int, ...] | None]] = {}
    for name, value in (pair for info in infos for pair in info.items()):
        if value is not None and isinstance(name, str) and name.isidentifier():
            shapes.setdefault(name, set()).add(_shape(value))
    return {name: shape for name, (shape, *others) in shapes.items() if shape is not None and not others}


def _shape(value: Any) -> tuple[int, ...] | None:
    array = np.asarray(value) if isinstance(value, bool | int | float | np.generic | np.ndarray) else np.empty(0)
    return array.shape if array.size and array.dtype.kind in "biuf" and array.ndim <= 1 else None


def variables(found: Survey, hidden: frozenset[str] = frozenset()) -> tuple[tuple[StateVar, slice | str], ...]:
    """The variables that rewards may read, each with its place: columns of the observation, or a name of `info`.

    Entries of `info` are left out if they are in `hidden` or if their name hints at reward or success.
    """
    if found.named:
        unsaid = hidden.union(documents.TAKEN)
        return tuple((v, v.name) for v in found.named if v.name not in unsaid and not documents.betrays(v.name))
    made = [*_observed(found)]
    taken = {variable.name for variable, _ in made}.union(documents.TAKEN)
    for name, shape in found.infos.items():
        if name not in hidden and name not in taken and not documents.betrays(name):
            meaning = f"{name.replace('_', ' ')}, as `info` has it"
            called = documents.identifiers([name])[0] if hasattr(builtins, name) else name
            made.append((StateVar(called, meaning, shape, use=documents.use_of(name)), name))
    return tuple(made)


def _observed(found: Survey) -> list[tuple[StateVar, slice | str]]:
    single = found.parts[0] if len(found.parts) == 1 and not found.parts[0].path else None
    if single is not None:
        if len(single.shape) != 1:
            meaning = f"the observation as a table, {' x '.join(map(str, single.shape))}"
            return [(StateVar("observation", meaning, single.shape, use="raw"), slice(0, single.size))]
        # A table of whole numbers names the numbers, not their one-hot columns.
        bare = documents.bare(found.env)
        named = documents.columns(found.document, bare, single.size) if not single.counts else []
        if not named and single.size <= MAX_COLUMNS:
            named = [(f"observation_{i}", meaning) for i, meaning in enumerate(single.columns)]
        columns = [
            (StateVar(name, meaning, use=documents.use_of(f"{name} {meaning}")), slice(i, i + 1))
            for i, (name, meaning) in enumerate(named)
        ]
        return [*columns, *_sections(found.sections, len(columns))]
    names = documents.identifiers(" ".join(map(str, part.path)) for part in found.parts)
    made: list[tuple[StateVar, slice | str]] = []
    start = 0
    for name, part in zip(names, found.parts, strict=True):
        use = documents.use_of(name) if len(part.shape) == 1 else "raw"
        meaning = f"`{'.'.join(map(str, part.path))}` of the observation, a {part.kind}"
        meaning += ": a one for its value, and zeros" if part.counts else ""
        made.append((StateVar(name, meaning, part.shape, use=use), slice(start, start + part.size)))
        start += part.size
    return made


def _sections(sections: Mapping[str, int], start: int) -> Iterator[tuple[StateVar, slice]]:
    """Parts of a vector that come after its named columns, as the environment itself names them."""
    end = 0
    for name, size in sections.items():
        begin, end = end, end + size
        if begin >= start and size:
            yield StateVar(name, f"`{name}` of the observation", (size,)), slice(begin, end)


def action_meaning(found: Survey) -> str:
    """What the variable `actions` is."""
    if not found.actions.choices:
        return "last action, in [-1, 1] for the range of the environment"
    if len(found.actions.choices) == 1:
        return "last action: a one in the column of what was chosen, and zeros"
    return f"last action: of choices among {', '.join(map(str, found.actions.choices))} a one for each, and zeros"
