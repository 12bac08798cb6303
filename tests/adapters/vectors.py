"""Gymnasium's own vector environments, for `env=python:FILE.py:NAME`."""

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv


class Cells(gymnasium.Env):
    """Observes two whole numbers."""

    observation_space = spaces.MultiDiscrete([2, 3], start=[0, 5])
    action_space = spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.array([1, 6]), {}

    def step(self, action):
        return np.array([int(action), 7]), 1.0, False, False, {}


class Several(Cells):
    """Observes a tuple: a discrete option, and a dictionary of numbers."""

    observation_space = spaces.Tuple(
        (spaces.Discrete(3, start=-1), spaces.Dict({"far": spaces.Box(-9.0, 9.0, (2,), np.float32)}))
    )

    def __init__(self, far):
        self.far = np.full(2, far, np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return (-1, {"far": np.zeros(2, np.float32)}), {}

    def step(self, action):
        return (int(action) - 1, {"far": self.far}), 1.0, False, False, {}


def cells(worlds):
    return SyncVectorEnv([Cells] * worlds, autoreset_mode=AutoresetMode.DISABLED)


def several(worlds, model=3.5):
    return SyncVectorEnv([lambda: Several(model)] * worlds, autoreset_mode=AutoresetMode.DISABLED)


def old(worlds):
    """As before Gymnasium 1.1: it does not say that it resets itself."""
    env = SyncVectorEnv([Cells] * worlds)
    env.metadata = {}
    return env


def poles(worlds):
    return SyncVectorEnv([lambda: gymnasium.make("CartPole-v1")] * worlds, autoreset_mode=AutoresetMode.DISABLED)


def listed(worlds):
    return [gymnasium.make("CartPole-v1") for _ in range(worlds)]


def listed_several(worlds):
    return [Several(3.5) for _ in range(worlds)]


def single(worlds):
    return gymnasium.make("CartPole-v1")
