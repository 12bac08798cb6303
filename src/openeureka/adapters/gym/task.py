"""A Gymnasium environment as it is: it steps and resets itself, and pays what its authors made it pay."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

import mujoco
import torch
from torch import Tensor

from ...errors import TaskError, nearest
from ...tasks.noise import WorldNoise
from ...tasks.task import Recipe, Score, State, Task, mean_over_episodes, mean_over_steps
from ...types import RewardGraph, StateSpec, StateVar
from . import documents
from .export import draft, wrapper
from .formula import formula
from .survey import Survey, action_meaning, variables
from .worlds import GymWorlds

SUCCESS = ({"is_success"}, {"success"})
"""If `fitness=` names one of these alone, F is whether an episode ends in success. `info` may have it in every step or
at the end only."""
CONTINUOUS = Recipe(hidden=(64, 64), env_steps=1_000_000, worlds=32, horizon=64, epochs=8, minibatches=8)
DISCRETE = Recipe(hidden=(64, 64), env_steps=500_000, worlds=32, horizon=64, epochs=8, minibatches=8, entropy_coef=0.01)

Info = Mapping[str, Tensor]
"""Numbers of `info` (N, ...)."""


class PaidTask(Task):
    """A task that knows an environment by its observation, its `info` and its reward. That reward is the human reward;
    F is its sum over an episode, or what `fitness=` says."""

    suite = "gymnasium"
    memory = ("returned",)
    decided: ClassVar[tuple[str, ...]] = ("control_dt", "substeps", "num_observations", "num_actions")
    """Attributes that nobody can set: they follow from the environment."""
    survey: ClassVar[Survey]
    places: ClassVar[Mapping[str, slice | str]]
    """Where each state variable is: columns of the observation, or a name of `info`."""
    keywords: ClassVar[Mapping[str, Any]] = {}
    """What the environment's constructor is given besides its id."""
    step_fitness: Callable[[Tensor, Info], Tensor] | None = None
    """F of a step, from `observation` and `info`; None for the sum of the environment's reward."""
    at_end: ClassVar[bool] = True
    """Whether F is taken at the end of an episode or, if not, in every step."""

    def __init__(self, sim: Any, noise: WorldNoise) -> None:
        super().__init__(sim, noise)
        self.paid = torch.zeros(self.num_envs, device=self.device)
        """The environment's own reward in the last step."""
        self.returned = torch.zeros(self.num_envs, device=self.device)
        """Its sum over the episode so far."""
        self.shapes = {variable.name: variable.shape for variable in self.spec.variables}

    @classmethod
    def drafted(cls, name: str, own: str, intent: str) -> str:
        return draft(cls, name, own, intent)

    @classmethod
    def handed_back(cls, graph: RewardGraph, program: str) -> str:
        return wrapper(cls, graph, program)

    @classmethod
    def acting(cls) -> dict[str, list[float]]:
        return cls.survey.actions.told()

    @abstractmethod
    def observation(self) -> Tensor:
        """(N, O) observation, fresh."""

    @abstractmethod
    def previous_observation(self, observation: Tensor) -> Tensor:
        """(N, O) observation before the last step, fresh; at the start of an episode, the current `observation`."""

    @abstractmethod
    def info(self) -> Info:
        """The numbers of `info` (N, ...), fresh."""

    @abstractmethod
    def env_reward(self, terminated: Tensor) -> Tensor:
        """(N,) the environment's own reward of the last step, fresh."""

    def compute_state(self) -> dict[str, Any]:
        observation = self.observation()
        named = cut(self.places, self.shapes, observation, self.info())
        previous = self.previous_observation(observation)
        whole = {"obs_buf": observation, "previous_obs_buf": previous, "actions": self.actions}
        return named | whole

    def observe(self, s: State) -> Tensor:
        return s["obs_buf"]

    def outcome(self, s: State) -> Tensor:
        """What F gains in this step. If F is taken at the end of an episode, 0 before the end."""
        terminated = self.terminated(s)
        self.paid = self.env_reward(terminated)
        self.returned = self.returned + self.paid
        value = self.returned
        if self.step_fitness is not None:
            value = torch.where(self.sim.bad, 0.0, self.step_fitness(s["obs_buf"], self.info()))
        return torch.where(terminated | self.timed_out(s), value, 0.0) if self.at_end else value

    def fitness(self, s: State, ended: Tensor) -> Score:
        return mean_over_episodes(s["outcome"], ended) if self.at_end else mean_over_steps(s["outcome"])

    def human_reward(self, s: State) -> Tensor:
        """(N,) what the environment paid in the last step."""
        return self.paid.clone()

    def sparse_reward(self, s: State) -> Tensor:
        return s["outcome"].clone()


class GymTask(PaidTask):
    """An environment that steps itself."""

    substeps = 1
    steps_itself = True
    make: ClassVar[Any]
    """A static function without arguments: makes one environment."""

    def __init__(self, sim: Any, noise: WorldNoise) -> None:
        super().__init__(sim, noise)
        self.gym: GymWorlds = sim

    @staticmethod
    def model() -> mujoco.MjSpec:
        raise TaskError("An environment that steps itself has no MuJoCo model.")

    @classmethod
    def simulate(cls, num_worlds: int, device: str, threads: int) -> Any:
        """Raises TaskError for any device but the CPU, where Gymnasium steps."""
        if device != "cpu":
            raise TaskError(f"`{cls.env}` steps itself, only on the CPU; leave device={device} out.")
        return GymWorlds(cls.make, num_worlds, cls.survey, name=cls.env, episode=cls.episode_length)

    def compute_state(self) -> dict[str, Any]:
        return super().compute_state() | {"actions": self.survey.actions.seen(self.actions)}

    def apply_action(self, actions: Tensor) -> None:
        self.gym.action.copy_(actions)

    def observation(self) -> Tensor:
        return self.gym.observation.clone()

    def previous_observation(self, observation: Tensor) -> Tensor:
        return self.gym.previous.clone()

    def info(self) -> Info:
        return {name: value.clone() for name, value in self.gym.info.items()}

    def env_reward(self, terminated: Tensor) -> Tensor:
        return self.gym.reward.clone()

    def terminated(self, s: State) -> Tensor:
        return self.gym.terminated.clone()

    def timed_out(self, s: State) -> Tensor:
        return super().timed_out(s) | self.gym.truncated

    def reset(self, worlds: Tensor) -> None:
        # Two draws, as one has 24 random bits only, and some environments choose their level by the seed's last bits.
        high, low = self.noise.uniform(worlds, 2, 0.0, 2.0**16).long().unbind(1)
        self.gym.seeds[worlds] = (high << 15) | (low >> 1)  # 31 bits: NumPy's old generators take no more than 32
        self.returned[worlds] = 0.0


def cut(
    places: Mapping[str, slice | str], shapes: Mapping[str, tuple[int, ...]], observation: Tensor, info: Info
) -> dict[str, Tensor]:
    """Variables by name, taken from their places in an observation (N, O) and in `info`.

    Raises TaskError where a task file names a variable or an entry of `info` that does not exist.
    """
    for name, place in places.items():
        if name not in shapes:
            raise TaskError(f"`places` lists `{name}`, but `spec` does not; rename it in both, or delete it in both.")
        if isinstance(place, str) and place not in info:
            raise TaskError(
                f"`places` says that `{name}` is `{place}` of `info`, which the environment did not report in random "
                f"play.{nearest(place, info)} It reported {', '.join(info) or 'nothing'}."
            )
    return {
        name: info[place] if isinstance(place, str) else observation[:, place].reshape(-1, *shapes[name])
        for name, place in places.items()
    }


def attributes(name: str, found: Survey, fitness: str) -> dict[str, Any]:
    """Class attributes of the `PaidTask` of one environment.

    Args:
        name: as `env=` names it.
        found: the survey of an instance.
        fitness: an expression over state variables and `info`, or empty.

    Raises:
        TaskError: for an expression that is not understood.
    """
    step_fitness, named = _step_fitness(found, fitness) if fitness else (None, frozenset[str]())
    listed = variables(found, named)
    whole = [
        StateVar("obs_buf", "the whole observation", (found.size,)),
        StateVar("previous_obs_buf", "the observation before the last step", (found.size,)),
        StateVar("actions", action_meaning(found), (found.actions.size,)),
    ]
    succeeds = named in SUCCESS
    # A prompt shows the unit, so it must not hold the expression, which would give F away.
    unit = "mean of a number over steps" if fitness else "sum of the environment's reward over an episode"
    return {
        "env": name,
        "description": documents.intent(found.document, found.env),
        "source": documents.told(found.document, {variable.name for variable, _ in listed})
        or "Nothing of it is shown. All that a reward may use is in the state table.",  # there may be none
        "score_unit": "share of episodes that succeed" if succeeds else unit,
        "episode_length": found.steps,
        "control_dt": found.dt,
        "timed": found.timed,
        "decided": tuple(name for name in PaidTask.decided if found.timed or name != "control_dt"),
        "num_observations": found.size,
        "num_actions": found.actions.size,
        "choices": found.actions.choices,
        "spec": StateSpec((*(variable for variable, _ in listed), *whole)),
        "recipe": DISCRETE if found.actions.choices else CONTINUOUS,
        "survey": found,
        "places": {variable.name: place for variable, place in listed},
        "step_fitness": staticmethod(step_fitness) if step_fitness else None,
        "at_end": not fitness or succeeds,
    }


def _step_fitness(found: Survey, fitness: str) -> tuple[Callable[[Tensor, Info], Tensor], frozenset[str]]:
    """F of a step, and the names in its expression: the environment's own, whatever a task file calls them."""
    known = variables(found)
    shapes = {**found.infos, **{variable.name: variable.shape for variable, _ in known}}
    value, named = formula(fitness, shapes)
    places = {**{name: name for name in found.infos}, **{variable.name: place for variable, place in known}}
    used = {name: places[name] for name in named}
    return lambda observation, info: value(cut(used, shapes, observation, info)), named
