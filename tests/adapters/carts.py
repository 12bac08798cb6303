"""Environments for `env=python:FILE.py:NAME`, of the kinds that another Python may offer. They need only NumPy."""

import os
import signal
import subprocess
import sys
import time

import numpy as np


class Carts:
    """N carts on a line.

    ## Description
    The goal is to stop at a mark.
    """

    num_actions, max_episode_steps, dt = 1, 40, 0.05
    meanings = {"place": "position on the line [m]", "speed": "velocity [m/s]", "mark": "where to stop [m]"}  # noqa: RUF012

    def __init__(self, worlds, fault="", step=1000, file="", pull=1.0):
        self.place, self.speed, self.mark = np.zeros((3, worlds))
        self.fault, self.step_of_fault, self.file, self.pull, self.count = fault, step, file, pull, 0

    def reset(self, *, seed, options):
        for world in np.flatnonzero(options["reset_mask"]):
            self.place[world], self.mark[world] = np.random.default_rng(seed[world]).uniform(-1.0, 1.0, 2)
            self.speed[world] = 0.0
        return self.seen(), self.told()

    def step(self, actions):
        self.count += 1
        if self.count == self.step_of_fault and not (self.file and os.path.exists(self.file)):
            self.fail()
        self.speed += 0.2 * (3.0 * self.pull * actions[:, 0] - self.speed)
        self.place += 0.05 * self.speed
        gap, off = np.abs(self.place - self.mark), np.abs(self.place) > 2.0
        return self.seen(), -gap, off, np.zeros(len(gap), bool), self.told()

    def fail(self):
        if self.file:
            open(self.file, "w").close()
        if self.fault == "raise":
            raise ValueError("the battery is empty")
        if self.fault == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.fault == "leave":
            with open(f"{self.file}-pid", "w") as told:
                told.write(str(subprocess.Popen(["sleep", "900"]).pid))
        if self.fault == "terminate":
            os.kill(os.getpid(), signal.SIGTERM)
        if self.fault == "hang":
            time.sleep(60.0)
        if self.fault == "print":
            os.write(1, b"\0\1rubbish" * 999)
            print("\x00rubbish" * 999, flush=True)
            sys.stderr.write("rubbish\n")

    def seen(self):
        return np.stack([self.place, self.speed, self.mark], axis=1)

    def told(self):
        return {"place": self.place, "speed": self.speed, "mark": self.mark, "reward_part": self.speed, 7: self.speed}


class Shared(Carts):
    """Returns one number for all worlds as result number `place` (0 to 3). With `place=4`, `speed` in `info` has one
    axis too many."""

    def __init__(self, worlds, place=1):
        super().__init__(worlds)
        self.where = place

    def step(self, actions):
        given = list(super().step(actions))
        if self.where < 4:
            given[self.where] = given[self.where].mean()
        elif self.count > 1:
            given[4]["speed"] = given[4]["speed"][:, None]
        return tuple(given)


class Pair:
    """A dictionary of observations, and two choices."""

    num_envs = 0

    class single_action_space:  # as Gymnasium's MultiDiscrete
        nvec = np.array([2, 3])

    def __init__(self, worlds):
        self.first = np.zeros((worlds, 2))

    def reset(self, *, seed, options):
        return self.seen(), {}

    def step(self, actions):
        self.first = actions.astype(float)
        flags = np.zeros(len(actions), bool)
        return self.seen(), self.first.sum(1), flags, flags, {}

    def seen(self):
        return {"taken": self.first, "inner": {"double": 2.0 * self.first}}


class Bits:
    """Observes the bits of its last action."""

    num_envs = 0

    class single_action_space:  # as Gymnasium's MultiBinary
        n = 3
        shape = (3,)

    def __init__(self, worlds):
        self.taken = np.zeros((worlds, *self.single_action_space.shape))

    def reset(self, *, seed, options):
        return self.taken.copy(), {}

    def step(self, actions):
        self.taken[:] = actions.reshape(self.taken.shape)
        flags = np.zeros(len(actions), bool)
        return self.taken.copy(), self.taken.sum(1), flags, flags, {}


class Counted(Bits):
    """Like `Bits`, with two choices that do not begin at 0."""

    class single_action_space:
        nvec = np.array([2, 3])
        start = np.array([1, 5])
        shape = (2,)


class Whole(Bits):
    """Like `Bits`, with whole numbers from 5 to 9; any other number raises an error."""

    class single_action_space:
        low, high = np.array([5, 5]), np.array([9, 9])
        shape, dtype = (2,), low.dtype

    def step(self, actions):
        if actions.min() < 5 or actions.max() > 9:
            raise ValueError("out of range")
        return super().step(actions)


class Rated:
    """Observes how far each action is from the previous one. It keeps the previous action's array, not a copy."""

    num_actions = 1

    def __init__(self, worlds):
        self.last = np.zeros((worlds, 1))

    def reset(self, *, seed, options):
        self.last = np.zeros_like(self.last)
        return self.last, {}

    def step(self, actions):
        change, self.last = actions - self.last, actions
        flags = np.zeros(len(actions), bool)
        return change, -np.abs(change[:, 0]), flags, flags, {}


class Alone(Carts):
    """Makes one cart, however many worlds it is asked for."""

    def __init__(self, worlds):
        super().__init__(1)

    def reset(self, *, seed, options):
        return self.seen(), self.told()


def resets_itself(worlds):
    carts = Carts(worlds)
    carts.metadata = {"autoreset_mode": "AutoresetMode.NEXT_STEP"}
    return carts
