"""Environments whose numbers can be told apart, registered as `Openeureka/NAME-v0`."""

import sys
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.envs.classic_control import CartPoleEnv


class Clock(gymnasium.Env):
    """Observes the step; `info` has `luck`, which is drawn from the episode's seed. Pays ten times the step, ends after
    `end` steps, truncates after `cut`."""

    metadata = {"render_modes": []}  # noqa: RUF012  as Gymnasium has it
    observation_space = spaces.Dict(
        {"step": spaces.Box(0.0, 100.0, (1,)), "phase": spaces.Discrete(3), "words": spaces.Text(9)}
    )
    action_space = spaces.MultiDiscrete([2, 3])

    def __init__(self, end: int = 1000, cut: int = 1000, fault: int = -1) -> None:
        self.end, self.cut, self.fault = end, cut, fault

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        self.step_count, self.luck = 0, float(self.np_random.integers(1000))
        return self._seen(), {"luck": self.luck}

    def step(self, action):
        self.step_count += 1
        if self.step_count == self.fault:
            raise ValueError("the battery is empty")
        info = {
            "luck": self.luck,
            "first": int(action[0]),
            "second": int(action[1]),
            "reward_part": 5.0,
            "outcome": 2.0,
        }
        done = self.step_count >= self.end
        return self._seen(), 10.0 * self.step_count, done, not done and self.step_count >= self.cut, info

    def _seen(self):
        return {
            "step": np.array([self.step_count], np.float32),
            "phase": np.int64(self.step_count % 3),
            "words": "tick",
        }


class Void(Clock):
    """Observes NaN from step `cut` on, under names that mean something else in a reward."""

    observation_space = spaces.Dict({name: spaces.Box(0.0, 100.0, (1,)) for name in ("class", "actions", "torch")})

    def _seen(self):
        value = np.array([np.nan if self.step_count >= self.cut else 1.0], np.float32)
        return dict.fromkeys(self.observation_space, value)


class Teller(Clock):
    """Tells in `info` numbers of several types, None, an array whose length changes at every step, and one that grows
    at step 12."""

    def step(self, action):
        *moment, _ = super().step(action)
        half, lap = (1, None) if self.luck % 2 else (0.5, 7)
        touched, late = (np.zeros(number) for number in (self.step_count % 3, 1 + (self.step_count > 11)))
        return *moment, {"half": half, "luck": self.luck, "lap": lap, "touched": touched, "late": late, 7: 1.0}


class Presser(Clock):
    """Tells `pressed` in `info` at every other step, and a second number of `late` from step 12 on."""

    def step(self, action):
        *moment, _ = super().step(action)
        late = np.ones(1 + (self.step_count > 11))
        return *moment, {"late": late, **({"pressed": np.array([1.0, 2.0])} if self.step_count % 2 else {})}


class Vast(Clock):
    """Observes a number that 32 bits cannot hold."""

    observation_space = spaces.Box(-np.inf, np.inf, (1,), np.float64)

    def _seen(self):
        return np.array([-1e300])


class Astray(Clock):
    """Observes a phase outside its space from step `cut` on."""

    def _seen(self):
        return super()._seen() | {"phase": np.int64(0 if self.step_count < self.cut else -1)}


class Quitter(Clock):
    """Ends Python in step `cut`."""

    def step(self, action):
        if self.step_count + 1 == self.cut:
            sys.exit("the assets are missing")
        return super().step(action)


class Pointed(Clock):
    """Requires `goal` among the options of a reset, if it is given any options."""

    def reset(self, *, seed=None, options=None):
        if options is not None:
            options["goal"]
        return super().reset(seed=seed)


class Traffic(Clock):
    """Observes two numbers of each of three vehicles, and tells parts of its reward in `info`."""

    observation_space = spaces.Box(-np.inf, np.inf, (3, 2))

    def step(self, action):
        *moment, _ = super().step(action)
        told = ("rwd_dense", "speed_bonus", "sparse", "sparseness", "env_complete")
        return *moment, dict.fromkeys(told, 1.0)

    def _seen(self):
        return np.arange(6, dtype=np.float32).reshape(3, 2) + 10 * self.step_count


class Eye(Clock):
    """Observes a picture."""

    observation_space = spaces.Box(0, 255, (64, 48, 3), np.uint8)


class Several(Clock):
    """Pays two numbers in a step."""

    def step(self, action):
        seen, paid, *rest = super().step(action)
        return seen, np.array([paid, -1.0]), *rest


class Clear(Clock):
    """Draws itself in red, with a fourth channel for opacity."""

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012  as Gymnasium has it
    render_mode = "rgb_array"

    def render(self):
        return np.full((9, 16, 4), (255, 0, 0, 255), np.uint8)


class Cells(gymnasium.Env):
    """Observes two whole numbers, of which its documentation has a table.

    ## Observation Space

    | Num | Observation |
    | --- | --- |
    | 0 | Column of the cart |
    | 1 | Row of the cart |
    """

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012  and its constructor takes no `render_mode`
    observation_space = spaces.MultiDiscrete([2, 3], start=[0, 5])
    action_space = spaces.Discrete(2)

    def __init__(self) -> None: ...

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        return np.array([1, 6]), {"max": 3.0, "speed": 2.0}

    def step(self, action):
        return np.array([int(action), 7]), 1.0, False, False, {"max": 3.0, "speed": 2.0}


class Turned(CartPoleEnv):
    def _ordered(self, seen):
        return seen[::-1].copy()

    def reset(self, **given):
        seen, info = super().reset(**given)
        return self._ordered(seen), info

    def step(self, action):
        seen, *rest = super().step(action)
        return self._ordered(seen), *rest


class Solver(Clock):
    """Tells only at the end of an episode whether it succeeded and at which step. It succeeds if its `luck` is even."""

    def step(self, action):
        seen, paid, terminated, truncated, info = super().step(action)
        if terminated or truncated:
            info |= dict.fromkeys(("is_success", "success"), self.luck % 2 == 0) | {"late": self.step_count}
        return seen, paid, terminated, truncated, info


class Set(Clock):
    """Tells in `info` what its constructor was given. Its parameters have names that a task uses too."""

    def __init__(self, episode_length: int = 20, model: int = 0, name: int = 0, memory: int = 0, **given: Any) -> None:
        super().__init__(cut=episode_length)
        self.told = {"given_model": model, "given_name": name, "given_memory": memory}

    def step(self, action):
        *moment, _ = super().step(action)
        return *moment, self.told


class Whole(Clock):
    """Takes two whole numbers from 0 to 10, of which the second is always 4."""

    action_space = spaces.Box(np.array([0, 4]), np.array([10, 4]), dtype=np.int64)


class Fixed(Clock):
    """Takes two numbers, of which the second is always 0.5."""

    action_space = spaces.Box(np.float32([-1.0, 0.5]), np.float32([1.0, 0.5]))


class Heavy(CartPoleEnv):
    def __init__(self, mass: float = 1.0, **given: Any) -> None:
        super().__init__(**given)
        self.masscart = mass


def _stacked(**given: Any) -> gymnasium.Env:
    return gymnasium.wrappers.FlattenObservation(gymnasium.wrappers.FrameStackObservation(CartPoleEnv(**given), 2))


for name, maker in {"Cells": Cells, "Turned": Turned, "Heavy": Heavy, "Stacked": _stacked}.items():
    gymnasium.register(f"Openeureka/{name}-v0", entry_point=maker, max_episode_steps=20)


for kind in (Void, Eye, Teller, Presser, Astray, Quitter, Pointed, Whole, Fixed, Vast, Traffic, Several, Clear):
    gymnasium.register(f"Openeureka/{kind.__name__}-v0", entry_point=kind, max_episode_steps=20)


for name, settings in {
    "Clock-v0": {},
    "Short-v0": {"end": 3},
    "Cut-v0": {"cut": 4},
    "Faulty-v0": {"fault": 2},
}.items():
    gymnasium.register(f"Openeureka/{name}", entry_point=Clock, kwargs=settings, max_episode_steps=20)
gymnasium.register("Openeureka/Set-v0", entry_point=Set)
gymnasium.register("Openeureka/Solver-v0", entry_point=Solver, kwargs={"end": 12}, max_episode_steps=20)
