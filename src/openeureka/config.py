"""Settings of a run as a frozen dataclass, read from `key=value` words or from Python values."""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast, get_type_hints

from .errors import ConfigError, nearest

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

NO_MODEL = "none"
"""`model` of a run that searches for nothing: given rewards train, and are compared."""
NO_RANGES = "none"
"""`randomise` of a run whose worlds are the task's own."""
BONUSES = ("none", "original", "progress")
SCHEDULES = ("full", "halving")
OBSERVES = ("all", "measurable")
VIDEOS = ("all", "best", "none")
LOGS = ("", "wandb", "mlflow", "tensorboard")
FEEDBACKS = ("none", "human")
_LONGEST = 4096
"""Characters of a setting: those of the longest path."""
_MANY = 100_000
"""More than anybody asks for, and few enough to be counted through by who shows a run of somebody else."""
_COUNTS = (
    *("sample", "iteration", "feedback_timeout", "repair", "refill", "tune", "polish"),
    *("polish_steps", "steps", "worlds", "threads", "max_cost"),
)
FEWEST_TUNED = 4
"""Trainings of a tuning, and of a round of one: with fewer, nothing says which way is up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunConfig:
    """One search. Zero means: the default of the task (steps, worlds) or of the kind of model (sample, iteration)."""

    env: str = "cartpole"
    """A name of `eureka envs`, `FILE.py`, `pkg.mod:Class` or, of Gymnasium, `gym:ID`."""
    model: str = "local"
    """`local`, `local:PATH.gguf`, `random`, `replay:RUN` or `FILE.json`, or the name of a model at an endpoint."""
    base_url: str = ""
    """OpenAI-compatible endpoint; empty means the one the openai package uses."""
    sample: int = 0
    """Candidates per generation, K."""
    iteration: int = 0
    """Generations, N."""
    search: str = "best"
    """`best` (the best so far is the parent), `eureka` (as published) or `pkg.mod:Name` of your own."""
    init: str = ""
    """Begin with a given reward: `human`, or the path of a reward file; empty means with the model's own."""
    safety: str = ""
    """What the reward must also see to, in words for the model: `torques below 40 N m, smooth joints`."""
    limits: str = ""
    """The most of costs that a policy may have when it plays, or its reward cannot win: `torque=40 falls=0.1`."""
    feedback: str = "none"
    """`none`, or `human`: after each generation wait for what a person says of it."""
    feedback_timeout: float = 0.0
    """Seconds to wait for a person; 0 means for ever."""
    judge: str = "fitness"
    """Candidates are ranked by `fitness`, or by the `votes` of a person."""
    repair: int = 0
    """Repair turns a refused candidate may take before its slot is sampled anew."""
    refill: int = 2
    """Fresh samples a slot may take after refusals, or when it repeats a program of the run."""
    temperature: float = 1.0
    """Of the model's samples: higher ones differ more."""
    curriculum: str = ""
    """Stages to train each candidate through: one of the task's own, or a YAML file; empty means the task alone."""
    randomise: str = NO_RANGES
    """How worlds of training differ: `none`, `mild`, `wide`, or a YAML file of ranges."""
    observe: str = "all"
    """What policies see: `all` of the observation, or what is `measurable` on a robot."""
    tune: int = 0
    """Trainings that fit the numbers of the best reward after the search, its structure kept; 0 means none."""
    polish: int = 0
    """Trainings that carry the best policy on in the end, each in its own way; 0 means none."""
    polish_steps: int = 0
    """Environment steps of each of those; 0 means an eighth of the training that made the policy."""
    seed: int = 0
    """Of start states, noise and samples."""
    seeds: int = 3
    """Fresh seeds that the leading rewards train with at the end, at most; fewer where two already decide."""
    steps: int = 0
    """Environment steps per candidate, over all stages of a curriculum."""
    worlds: int = 0
    """Worlds per candidate."""
    schedule: str = "full"
    """How long candidates train: all of them in `full`, or by `halving` those alone that lead at each rung."""
    bonus: str = "none"
    """What generated rewards get: `none`; `original`, 250 on success in hand tasks; `progress`, pay for rare stages."""
    device: str = "cpu"
    """`cpu`, `cuda` (every GPU there is), or some of them, such as `cuda:0,cuda:1`."""
    threads: int = 0
    """Cores to train on; 0 means all of them."""
    executor: str = "local"
    """Where lanes run: `local`, on this machine, `ray`, on a cluster, or `pkg.mod:Name` of your own."""
    address: str = ""
    """Of the Ray cluster: `auto`, the one that this machine is part of, `HOST:PORT`, or `local`, one of its own."""
    max_cost: float = 0.0
    """Stop before the spending on replies exceeds this many US dollars; 0 means no limit."""
    price: str = ""
    """`INPUT,OUTPUT` in US dollars per million tokens; empty means the built-in table of prices."""
    baselines: str = "train"
    """`train` the human and the sparse reward along, or take what openeureka has `known` of them beforehand."""
    video: str = "best"
    """`all` trained policies, the `best` or `none`; with feedback=human `all` unless set."""
    log: str = ""
    """Mirror the run to `wandb`, `mlflow` or `tensorboard`; empty means nowhere, and no network."""
    dir: str = ""
    """Run directory; empty means `outputs/<time>_<env>`."""
    unsafe_no_sandbox: bool = False
    """Run generated code in an unconfined child process where the kernel cannot confine it."""

    def __post_init__(self) -> None:
        for key in _COUNTS:
            if getattr(self, key) < 0:
                raise ConfigError(f"`{key}` must be zero or more, not {getattr(self, key)}.")
        for key in ("sample", "iteration", "repair", "refill", "tune", "polish", "seeds"):
            if getattr(self, key) > _MANY:
                raise ConfigError(f"`{key}` must be at most {_MANY}.")
        if "@" in self.base_url.partition("://")[2].partition("/")[0]:
            raise ConfigError(
                "`base_url` must not hold a user or a password, as settings are stored and shown; set the environment "
                "variable OPENAI_API_KEY, or OPENAI_BASE_URL instead of base_url=."
            )
        if self.seeds < 1:
            raise ConfigError(f"`seeds` must be one or more, not {self.seeds}.")
        if 0 < self.tune < FEWEST_TUNED:
            raise ConfigError(f"`tune` must be 0 or at least {FEWEST_TUNED}, not {self.tune}.")
        if self.polish_steps and not self.polish:
            raise ConfigError("`polish_steps` says how long policies are carried on; add polish=4, or leave it out.")
        choices = {
            "feedback": FEEDBACKS,
            "judge": ("fitness", "votes"),
            "bonus": BONUSES,
            "schedule": SCHEDULES,
            "baselines": ("train", "known"),
            "video": VIDEOS,
            "observe": OBSERVES,
            "log": LOGS,
        }
        for key, allowed in choices.items():
            if getattr(self, key) not in allowed:
                raise ConfigError(
                    f"`{key}` must be one of {', '.join(filter(None, allowed))}, not `{getattr(self, key)}`."
                )
        if self.curriculum and self.schedule != "full":
            raise ConfigError(f"`schedule={self.schedule}` goes with no `curriculum=`; leave one of them out.")
        if self.limited and (self.search == "eureka" or self.model == NO_MODEL):
            raise ConfigError("`limits` needs a search that lets policies play; use it with search=best.")
        if self.judge == "votes" and self.feedback != "human":
            raise ConfigError("`judge=votes` needs someone who votes; add feedback=human.")

    @property
    def limited(self) -> dict[str, float]:
        """`limits` by the name of a cost."""
        found: dict[str, float] = {}
        for word in self.limits.replace(",", " ").split():
            name, _, most = word.partition("=")
            try:
                found[name] = float(most)
            except ValueError:
                found[name] = math.nan
            if not 0.0 <= found[name] < math.inf:
                raise ConfigError(f"`{word:.80}` in `limits` is no limit; write a cost and its most: torque=40.")
        return found

    @property
    def generations(self) -> int:
        """All generations: those of the model, after that of a given reward."""
        return self.iteration + bool(self.init) if self.model != NO_MODEL else 0

    @property
    def hearings(self) -> int:
        """Generations after which a person is heard. What follows the last one can only change who wins by votes."""
        if self.feedback != "human":
            return 0
        return self.generations if self.judge == "votes" else self.generations - 1


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainConfig:
    """Training of given rewards, without a language model. Zero means the default of the task."""

    env: str = "cartpole"
    reward: str = "human,sparse"
    """Comma-separated: `human`, `sparse` or the path of a reward file."""
    curriculum: str = ""
    """Stages to train each reward through: one of the task's own, or a YAML file; empty means the task alone."""
    randomise: str = NO_RANGES
    """How worlds of training differ: `none`, `mild`, `wide`, or a YAML file of ranges."""
    observe: str = "all"
    """What policies see: `all` of the observation, or what is `measurable` on a robot."""
    seeds: int = 1
    """Trainings per reward."""
    seed: int = 0
    """First seed."""
    steps: int = 0
    """Environment steps per training, over all stages of a curriculum."""
    worlds: int = 0
    """Worlds per training."""
    bonus: str = "none"
    """What generated rewards get: `none`; `original`, 250 on success in hand tasks; `progress`, pay for rare stages."""
    device: str = "cpu"
    """`cpu`, `cuda` (every GPU there is), or some of them, such as `cuda:0,cuda:1`."""
    threads: int = 0
    """Cores to train on; 0 means all of them."""
    executor: str = "local"
    """Where lanes run: `local`, on this machine, `ray`, on a cluster, or `pkg.mod:Name` of your own."""
    address: str = ""
    """Of the Ray cluster: `auto`, the one that this machine is part of, `HOST:PORT`, or `local`, one of its own."""
    log: str = ""
    """Mirror the run to `wandb`, `mlflow` or `tensorboard`; empty means nowhere, and no network."""
    dir: str = ""
    """Run directory; empty means `outputs/<time>_train_<env>`. One that holds such a run is continued."""
    unsafe_no_sandbox: bool = False
    """Run reward files in an unconfined child process where the kernel cannot confine it."""

    def __post_init__(self) -> None:
        if self.seeds < 1:
            raise ConfigError(f"`seeds` must be one or more, not {self.seeds}.")
        for key in ("steps", "worlds", "threads"):
            if getattr(self, key) < 0:
                raise ConfigError(f"`{key}` must be zero or more, not {getattr(self, key)}.")
        if self.bonus not in BONUSES:
            raise ConfigError(f"`bonus` must be one of {', '.join(BONUSES)}, not `{self.bonus}`.")

    def run(self) -> RunConfig:
        """The settings of the run: one that searches for nothing."""
        known = {field.name for field in dataclasses.fields(RunConfig)}
        shared = {field.name: getattr(self, field.name) for field in dataclasses.fields(self) if field.name in known}
        return RunConfig(model=NO_MODEL, video="none", **shared)


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneConfig(TrainConfig):
    """Fitting the numbers of one reward, its structure kept. Zero means the default of the task."""

    reward: str = "human"
    """`human`, the path of a reward file, or the directory of a run, whose best reward it is."""
    trials: int = 32
    """Trainings that the numbers are fitted by, the reward as it came among them."""
    sample: int = 8
    """Trainings side by side, after which the next ones are proposed."""
    seeds: int = 3
    """Fresh seeds that the best train with at the end, at most, beside the reward as it came."""
    dir: str = ""
    """Run directory; empty means `outputs/<time>_tune_<env>`. One that holds such a run is continued."""

    def __post_init__(self) -> None:
        TrainConfig.__post_init__(self)  # `super()` does not know a class with slots
        for key in ("trials", "sample"):
            if not FEWEST_TUNED <= getattr(self, key) <= _MANY:
                raise ConfigError(f"`{key}` must be from {FEWEST_TUNED} to {_MANY}, not {getattr(self, key)}.")

    def run(self) -> RunConfig:
        return dataclasses.replace(TrainConfig.run(self), tune=self.trials)


def short_name(env: str) -> str:
    """A task's name for files and titles: that of `some/where/pendulum.py:Pendulum` is `pendulum`."""
    name = re.sub(r"\+python=[^+]*", "", env).rpartition(":")[2]
    return re.sub(r"\W+", "_", Path(name).stem if name.endswith(".py") else name).lower()


_FILES = {
    "env": r"((?:python:)?)(.+\.py)([:+].*)?",
    "init": r"()(?!human\Z)(.+)()",
    "curriculum": r"()(.+\.ya?ml)()",
    "randomise": r"()(.+\.ya?ml)()",
    "model": r"(replay:|local:(?!hub:))(.+)()",
}


def absolute(key: str, value: str, folder: Path = Path()) -> str:
    """The whole path of a file that a setting names from a folder, so that it is found from any directory."""
    match = re.fullmatch(_FILES.get(key, "(?!)"), value)
    return f"{match[1]}{(folder / Path(match[2]).expanduser()).resolve()}{match[3] or ''}" if match else value


def elsewhere(settings: Mapping[str, object]) -> dict[str, object]:
    """The settings with `python=PATH` as a part of what `env` names: the interpreter that its environment lives in.

    The path is made whole but not followed: the interpreter of a virtual environment is a link.
    """
    found = dict(settings)
    if "env" not in found or "python" not in found:
        return found
    python = str(found.pop("python"))
    whole = os.path.abspath(os.path.expanduser(python)) if os.sep in python else python
    return found | {"env": f"{found['env']}+python={whole}"}


def _whole(value: str) -> int:
    """A whole number, also as people write large ones: `1e6`, `2.5e5`."""
    if re.fullmatch(r"[+-]?\d+(\.\d*)?[eE]\+?\d{1,2}", value) and float(value).is_integer():
        return int(float(value))
    return int(value)


_WANTED = {"int": "a whole number", "float": "a number", "bool": "true or false"}

Config = TypeVar("Config", bound="DataclassInstance")


def parse(kind: type[Config], words: Sequence[str]) -> Config:
    """Build a frozen config dataclass from `key=value` words. A value is taken as it is: nothing in it is looked up.

    Raises:
        ConfigError: for a word that is not `key=value`, an unknown key or a value of the wrong type.
    """
    return kind(**_typed(kind, words))


def changed(config: Config, words: Sequence[str]) -> Config:
    """The config with what `key=value` words say. Raises ConfigError as `parse` does."""
    return dataclasses.replace(config, **_typed(type(config), words))


def _typed(kind: type, words: Sequence[str]) -> dict[str, Any]:
    hints = get_type_hints(kind)
    values: dict[str, Any] = {}
    given: dict[str, object] = {}
    for word in words:
        key, sign, value = word.partition("=")
        if not sign:
            raise ConfigError(f"`{word}` is not of the form key=value, for example env=cartpole.")
        given[key] = value
    for key, value in elsewhere(given).items():
        _expect_known(key, hints)
        value = str(value)
        try:
            values[key] = _READ[hints[key]](absolute(key, value))
        except ValueError:
            raise _unfit(key, value, hints[key]) from None
    return values


def _expect_known(key: str, hints: Mapping[str, type]) -> None:
    if key not in hints:
        raise ConfigError(f"Unknown setting `{key}`.{nearest(key, hints)} Settings: {', '.join(hints)}.")


def _unfit(key: str, value: object, kind: type) -> ConfigError:
    wanted = _WANTED.get(kind.__name__, "text")
    return ConfigError(f"`{key}={value!s:.80}` does not fit: `{key}` takes {wanted}.")


def taken(kind: type, settings: Mapping[str, object]) -> dict[str, Any]:
    """Python values as the fields of a config dataclass hold them: paths as text, 1e6 as a whole number.

    Raises:
        ConfigError: for an unknown key or a value of the wrong type.
    """
    hints = get_type_hints(kind)
    values: dict[str, Any] = {}
    for key, value in elsewhere(settings).items():
        _expect_known(key, hints)
        wanted = hints[key]
        given: Any = str(value) if isinstance(value, Path) else value
        if wanted is int and isinstance(given, float) and given.is_integer():
            given = int(given)
        if type(given) is not wanted and (type(given), wanted) != (int, float):
            raise _unfit(key, value, wanted)
        values[key] = absolute(key, given) if isinstance(given, str) else wanted(given)
    return values


_SWITCH = {
    **dict.fromkeys(("true", "yes", "on", "y", "1"), True),
    **dict.fromkeys(("false", "no", "off", "n", "0"), False),
}


def _switch(text: str) -> bool:
    if text.lower() not in _SWITCH:
        raise ValueError(text)
    return _SWITCH[text.lower()]


_READ: Mapping[type, Callable[[str], Any]] = {str: str, int: _whole, float: float, bool: _switch}


def restored(kind: type[Config], stored: object) -> Config:
    """The config that `as_dict` was made of, from data of anybody's; fields that it lacks have their defaults.

    Raises:
        ConfigError: for an unknown field or a value that does not fit.
        TypeError: for what is no such data: another type, or text that nobody types.
    """
    hints = get_type_hints(kind)
    if not isinstance(stored, dict):
        raise TypeError("settings are a mapping")
    settings = cast(dict[str, object], stored)
    for key, value in settings.items():
        if key not in hints:
            raise ConfigError(f"There is no setting `{key}`.")
        if type(value) is not hints[key] and (type(value), hints[key]) != (int, float):
            raise TypeError(f"`{key}` takes {hints[key].__name__}")
        if isinstance(value, str) and (len(value) > _LONGEST or "\0" in value):
            raise TypeError(f"`{key}` is no text of a setting")
    return kind(**settings)


def as_dict(config: DataclassInstance) -> dict[str, object]:
    """Every field of a config dataclass, for storing and printing it back."""
    return dataclasses.asdict(config)
