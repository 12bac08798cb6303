"""What a task is: one MDP over N worlds, written top to bottom in one file."""

from __future__ import annotations

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import mujoco
import torch
from torch import Tensor

from ..errors import TaskError
from ..reward.graph import CompiledReward
from ..sim import Simulator, open_simulator
from ..sim.base import Capacity
from ..types import Observe, RewardGraph, StateSpec
from . import human
from .deployment import Deployment
from .noise import WorldNoise

State = Mapping[str, Any]
"""State variable name -> value: world variables are tensors (N, ...), constants tensors, the rest Python numbers. After
a step, a task that has an `outcome` adds it (see `Task.outcome`)."""


INTEGRATOR = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
"""How physics is stepped, whatever the model's file says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """A task's PPO defaults (Eureka's rl_games settings, adapted to one CPU or GPU; see docs/concepts/benchmark.md)."""

    hidden: tuple[int, ...]
    env_steps: int
    """Environment steps of one lane."""
    worlds: int = 256
    """Worlds of one lane."""
    horizon: int = 16
    epochs: int = 4
    """Passes over a batch."""
    minibatches: int = 4
    learning_rate: float = 3e-4
    kl_threshold: float = 0.008
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip: float = 0.2
    critic_coef: float = 2.0
    bounds_coef: float = 1e-4
    entropy_coef: float = 0.0
    reward_scale: float = 1.0
    max_grad_norm: float | None = 1.0
    noise: float = 1.0
    """Initial standard deviation of actions, whose range is -1 to 1."""
    head: float = 1.0
    """Scale of the initial weights of the action means (0.01 in arXiv 2006.05990)."""
    bootstrap_timeouts: bool = True

    def __post_init__(self) -> None:
        if not isinstance(self.hidden, tuple | list):
            raise ValueError(f"hidden={self.hidden!r} in the recipe must be the sizes of the layers, such as (64, 64)")
        for name in ("worlds", "horizon", "epochs", "minibatches"):
            value = getattr(self, name)
            if not isinstance(value, int) or value < 1:
                raise ValueError(f"{name}={value!r} in the recipe must be a whole number above zero")


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """How pictures show a task. Everything that moves fits into them where it is at the start."""

    azimuth: float = 120.0
    """Direction of sight about z, from x [degrees]."""
    elevation: float = -15.0
    """[degrees]"""
    swept: bool = False
    """Whether what joints with a range move fits into them everywhere in that range, not only at the start."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """One part of a curriculum, in which a lane goes on from the policy of the stage before with the same reward.

    `Stage()` is the task itself, with the steps of its recipe.
    """

    env: str = ""
    """Another task with the same observations, actions and state variables; empty means the task itself."""
    set: Mapping[str, bool | int | float | str] = field(default_factory=dict)
    """Class attributes that are different here, such as `{"episode_length": 100}`."""
    steps: int = 0
    """Environment steps of a lane; 0 means those of the recipe."""


class Score(NamedTuple):
    """Contribution of each world to the fitness F, which over any window is sum(value * weight) / sum(weight)."""

    value: Tensor
    """(N,) float32."""
    weight: Tensor
    """(N,) float32; 0 where the world contributes nothing on this step."""


class Task(ABC):
    """One environment: model, state, observation, action, reset, termination, fitness, human and sparse reward.

    Subclasses hold what they remember of each world in attributes that `memory` names, and never loop over worlds.
    State tensors are fresh on every call (never views of simulator memory), quaternions are x, y, z, w.
    """

    env: ClassVar[str]
    suite: ClassVar[str]
    description: ClassVar[str]
    """The intent, one sentence, as the language model reads it."""
    score_unit: ClassVar[str] = ""
    """What F counts or measures, in a few words that a table has room for; higher F is better."""
    score_range: ClassVar[tuple[float | None, float | None]] = (None, None)
    """Least and highest F there can be; None where nothing bounds it."""
    ends: ClassVar[str] = ""
    """When `terminated` ends an episode: a sentence for the language model, which does not say what F wants."""
    scores_episodes: ClassVar[bool] = False
    """Whether F is about whole episodes in every step: steps of an episode that began in its middle have no weight."""
    counts_early: ClassVar[bool] = False
    """Whether F in training counts the first episodes that end, where it counts only whole ones. That is right where
    only a failure ends one early. Elsewhere the first to end are quick successes, and F waits (`training.curves`)."""
    episode_length: ClassVar[int]
    """[steps]"""
    time_out_early: ClassVar[int] = 0
    """[steps] by which the time-out comes before episode_length: 1 in the originals of `isaac`."""
    control_dt: ClassVar[float]
    """[s] between two actions."""
    timed: ClassVar[bool] = True
    """Whether `control_dt` is known. If it is only a guess, no prompt speaks of seconds."""
    substeps: ClassVar[int]
    """Physics steps per action; the model's timestep is control_dt / substeps."""
    num_observations: ClassVar[int]
    num_actions: ClassVar[int]
    choices: ClassVar[tuple[int, ...]] = ()
    """Options of each discrete choice, `num_actions` in all: an action then has a one for each option that is taken,
    and zeros elsewhere. Empty means continuous actions."""
    clip_observations: ClassVar[float] = math.inf
    max_contacts: ClassVar[int] = 0
    """Contacts that the GPU simulator has room for, in an average world; 0 means a guess from the model."""
    max_constraints: ClassVar[int] = 0
    """Constraint rows that the GPU simulator has room for in any world; 0 means a guess from the model."""
    spec: ClassVar[StateSpec]
    recipe: ClassVar[Recipe]
    view: ClassVar[View] = View()
    curricula: ClassVar[Mapping[str, tuple[Stage, ...]]] = {}
    """What `curriculum=NAME` trains instead of the task alone; each ends with the task itself."""
    memory: ClassVar[tuple[str, ...]] = ()
    """Attributes, tensors (N, ...), that last from step to step: all that `reset` writes, and what else a step leaves
    to later ones. Those of a base class must be listed too."""
    source: ClassVar[str] = ""
    """What the language model reads in place of the task's own code; empty for that."""
    unmeasured: ClassVar[tuple[tuple[str, range], ...]] = ()
    """What no sensor of the robot tells: state variables, and their columns of the observation."""
    steps_itself: ClassVar[bool] = False
    """Whether the task runs without MuJoCo: its masses cannot be changed, and its worlds render their own pictures."""
    deployment: ClassVar[Deployment | None] = None
    """What a robot's computer must know to run a policy; None where it cannot compute the observation."""
    human: ClassVar[str | Path] = ""
    """The reward its original authors wrote: a reward program, or the file that holds it. Empty where the task has a
    method `human_reward` instead, which no search can begin with."""

    def __init__(self, sim: Simulator, noise: WorldNoise) -> None:
        self.sim = sim
        self.noise = noise
        self.num_envs = sim.num_worlds
        self.device = sim.device
        self.progress = torch.zeros(self.num_envs, dtype=torch.int64, device=self.device)
        self.actions = torch.zeros(self.num_envs, self.num_actions, device=self.device)
        self._human: CompiledReward | None = None

    @staticmethod
    @abstractmethod
    def model() -> mujoco.MjSpec:
        """The robot and its scene. Timestep and shared solver options are set by `compile_model`."""

    @classmethod
    def simulate(cls, num_worlds: int, device: str, threads: int) -> Simulator:
        """N copies of its model. A task that `steps_itself` gives other `Worlds`, and uses only what these offer."""
        room = Capacity(cls.max_contacts, cls.max_constraints)
        return open_simulator(cls.compile_model(), num_worlds, device=device, threads=threads, room=room)

    @abstractmethod
    def apply_action(self, actions: Tensor) -> None:
        """Turn actions (N, A), already clamped to [-1, 1] or chosen, into simulator inputs."""

    def advance(self) -> None:
        """Simulate one control step."""
        self.sim.step(self.substeps)

    @abstractmethod
    def compute_state(self) -> dict[str, Any]:
        """Every variable of `spec`, from the simulator's current fields."""

    @abstractmethod
    def observe(self, s: State) -> Tensor:
        """(N, O) observation before clipping; also what `obs_buf` holds."""

    @abstractmethod
    def terminated(self, s: State) -> Tensor:
        """(N,) bool: the episode failed or succeeded on this step."""

    def timed_out(self, s: State) -> Tensor:
        """(N,) bool: the episode is cut off after this step."""
        return self.progress >= self.time_limit()

    @abstractmethod
    def reset(self, worlds: Tensor) -> None:
        """Write the start state of worlds (k,) into the simulator's state fields and this task's memory.

        On a GPU all worlds are written, and those that go on are put back.
        """

    def outcome(self, s: State) -> Tensor | None:
        """(N,) what F and the sparse reward have in common on this step, or None. They read it as `s["outcome"]`, which
        no reward program can.

        Called once a step, before both. A task may update what it remembers here, such as a success or a count, but not
        there.
        """
        return None

    @abstractmethod
    def fitness(self, s: State, ended: Tensor) -> Score:
        """F of the original benchmark, per world; no reward ever sees it. `ended` (N,): a whole episode ended here."""

    def human_reward(self, s: State) -> Tensor:
        """(N,) what the program in `human` computes. Raises TaskError when it breaks a rule of reward programs."""
        if self._human is None:
            self._human = human.compiled(type(self), s)
        return self._human(s)[0]

    @abstractmethod
    def sparse_reward(self, s: State) -> Tensor:
        """(N,) reward that is the fitness itself, per world."""

    def tensors(self) -> dict[str, Tensor]:
        """Every attribute that is a tensor, except for the simulator's own memory."""
        bound = {value.untyped_storage().data_ptr() for value in self.sim.memory().values()}
        own = {name: value for name, value in vars(self).items() if isinstance(value, Tensor)}
        return {name: value for name, value in own.items() if value.untyped_storage().data_ptr() not in bound}

    def success_bonus(self, s: State) -> Tensor | None:
        """(N,) what the original adds to generated rewards on success, unknown to their author; None for nothing."""
        return None

    def ghosts(self) -> Mapping[str, Tensor]:
        """Where bodies of the model should be now, for pictures: position and quaternion (N, 7) by the body's name."""
        return {}

    @classmethod
    def drafted(cls, name: str, own: str, intent: str) -> str:
        """A task file with a class `name` that is called `own`, and says what rewards may read of this environment.

        Raises TaskError for a task that is a file already.
        """
        raise TaskError(f"`{cls.env}` already has a task file, which says what rewards may read: copy that file.")

    @classmethod
    def handed_back(cls, graph: RewardGraph, program: str) -> str:
        """A file with a reward for the suite that the environment comes from.

        Raises TaskError for a task of openeureka's own, which has no such suite.
        """
        raise TaskError(
            f"Rewards can be exported only for environments of other packages, such as gym:Hopper-v5, and `{cls.env}` "
            "is not one. The best reward of the run is in best/reward.py."
        )

    @classmethod
    def acting(cls) -> dict[str, list[float]]:
        """What a policy's actions mean to an environment that comes from elsewhere, as numbers by name for programs
        there; empty for a task of openeureka's own kind."""
        return {}

    @classmethod
    def lasting(cls) -> tuple[str, ...]:
        """Attributes that are kept when a lane pauses; all others are then as in a new task."""
        return (*cls.memory, "progress", "actions")

    @classmethod
    def time_limit(cls) -> int:
        """Steps after which an episode is cut off: the `progress` at which a time-out is raised."""
        return cls.episode_length - cls.time_out_early

    @classmethod
    def window(cls) -> int:
        """Epochs that F in training is averaged over: as many as an episode lasts."""
        return -(-cls.episode_length // cls.recipe.horizon)

    @classmethod
    def unseen(cls, observe: Observe) -> tuple[int, ...]:
        """Columns of the observation that a policy does not see."""
        hidden = cls.unmeasured if observe == "measurable" else ()
        return tuple(column for _, columns in hidden for column in columns)

    @classmethod
    def compiled(cls) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
        """`model()` and what it compiles to, at this task's timestep. Raises TaskError where MuJoCo refuses it."""
        spec = cls.model()
        if not isinstance(spec, mujoco.MjSpec):
            raise TaskError(
                f"{inspect.getsourcefile(cls)}: `model` of `{cls.__name__}` returns {type(spec).__name__}; it must"
                " return a mujoco.MjSpec, as mujoco.MjSpec.from_file does."
            )
        spec.option.timestep = cls.control_dt / cls.substeps
        spec.option.integrator = INTEGRATOR
        try:
            return spec, spec.compile()
        except ValueError as error:  # such as for a missing mesh
            text = " ".join(str(error).split())
            raise TaskError(
                f"{inspect.getsourcefile(cls)}: the model of `{cls.__name__}` does not compile: {text}"
            ) from error

    @classmethod
    def compile_model(cls) -> mujoco.MjModel:
        """The model that the worlds of the task run."""
        return cls.compiled()[1]


def mean_over_steps(value: Tensor) -> Score:
    """F is an average over all worlds and steps."""
    return Score(value, torch.ones_like(value))


def mean_over_episodes(value: Tensor, ended: Tensor) -> Score:
    """F is an average over the episodes that end in the window."""
    return Score(value.to(torch.float32), ended.to(torch.float32))
