"""What a language model may know of a task: the only names a reward may read."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Literal, get_args

StateKind = Literal["world", "constant", "float", "int", "num_envs"]
StateUse = Literal["raw", "zero_centred", "directional", "point"]


@dataclass(frozen=True, slots=True)
class StateVar:
    """One variable a reward may name as an argument."""

    name: str
    meaning: str
    """What it is, with unit and frame, as the language model reads it."""
    shape: tuple[int, ...] = ()
    """Shape without the world axis: () for a per-world scalar (N,), (3,) for (N, 3)."""
    _: KW_ONLY
    kind: StateKind = "world"
    """`world`: float32 tensor (N, *shape); `constant`: tensor `shape`, the same for all worlds, float32 (int64 where it
    holds indices); `float`, `int`: a Python number; `num_envs`: the number of worlds, a Python int."""
    use: StateUse = "raw"
    """How the typed grammar may use it. `raw`: not offered (original variables of mixed content). `zero_centred`: good
    when near zero, never a term by its sign. `directional`: more is meaningful (a speed, a projection). `point`: a
    position, used in distances to other points of equal shape."""

    def __post_init__(self) -> None:
        if not isinstance(self.shape, tuple):  # pyright: ignore[reportUnnecessaryIsInstance]  a person wrote it
            raise ValueError(f"the shape of `{self.name}` is {self.shape!r}; write a tuple, such as (3,)")
        for name, value, known in (("use", self.use, StateUse), ("kind", self.kind, StateKind)):
            if value not in get_args(known):
                raise ValueError(f"the {name} of `{self.name}` is {value!r}; it is one of {', '.join(get_args(known))}")


@dataclass(frozen=True, slots=True)
class StateSpec:
    """The ordered table of a task's state variables."""

    variables: tuple[StateVar, ...]

    def __post_init__(self) -> None:
        names = self.names
        if len(set(names)) != len(names):
            raise ValueError(f"state variable named twice in {names}")

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(variable.name for variable in self.variables)

    @property
    def per_world(self) -> tuple[str, ...]:
        """Names of the variables that have a value for each world."""
        return tuple(variable.name for variable in self.variables if variable.kind == "world")

    def __getitem__(self, name: str) -> StateVar:
        for variable in self.variables:
            if variable.name == name:
                return variable
        raise KeyError(name)

    def __contains__(self, name: object) -> bool:
        return name in self.names


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskContext:
    """What a language model may know of a task."""

    env: str
    description: str
    """The intent, one sentence."""
    state: StateSpec
    source: str
    """The task's file without fitness, rewards, success thresholds and training defaults, or its documentation."""
    documented: bool = False
    """Whether `source` is documentation, in Markdown, instead of code."""
    score_unit: str = ""
    """What the score counts or measures; higher is better."""
    score_range: tuple[float | None, float | None] = (None, None)
    """Least and highest possible score; None where there is no bound."""
    window: int = 1
    """Number of epochs over which the score of a training is averaged: as many as an episode lasts."""
    facts: tuple[str, ...] = ()
    """Lines on what the score does not tell: length, ends and starts of episodes, length of training, discount."""
