"""N worlds of a Gymnasium environment, stepped by Gymnasium's own vector API in this process."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from torch import Tensor

from ...errors import EurekaError, TaskError
from ...sim import Worlds
from ...tasks.faults import told_where
from .survey import Survey


class Together(SyncVectorEnv):
    """Worlds that never reset themselves, only by a mask: the caller ends some episodes early.

    Of `info`, the numbers in `infos` are kept, as float32 of the shapes given there. Gymnasium's own class keeps all,
    in the type that the first world has: 0.9 in a later world is cut to 0 if the first has an integer. A value whose
    shape changes later is ignored, as an error would end a search after hours. Only if F needs it (`wanted`), it is an
    error.
    """

    def __init__(
        self, make: Callable[..., Any], num_worlds: int, infos: Mapping[str, tuple[int, ...]], wanted: Collection[str]
    ) -> None:
        super().__init__([make] * num_worlds, autoreset_mode=AutoresetMode.DISABLED)
        self._infos, self._wanted = infos, wanted

    def _add_info(self, vector_infos: dict[str, Any], env_info: dict[str, Any], env_num: int) -> dict[str, Any]:
        for name, shape in self._infos.items():
            kept = vector_infos.setdefault(name, np.zeros((self.num_envs, *shape), np.float32))
            value = env_info.get(name)
            if value is None:
                continue
            if (now := np.shape(value)) == shape:
                kept[env_num] = value
            elif name in self._wanted:
                raise ValueError(f"`{name}` of `info` has the shape {now}, but had {shape} before; keep it the same")
        return vector_infos


class GymWorlds(Worlds):
    """Worlds that are reset when they are told to, each time with a new seed: an episode does not depend on what ran
    before it or in other worlds.

    The state of an arbitrary environment cannot be saved. But a seed and the actions since then lead to it again, so
    these are saved, and loading them replays the current episode of each world. An environment that draws random
    numbers from anywhere but its seed goes on from another state.

    Args:
        make: makes one environment.
        found: the survey of one.
        name: the environment's name in messages.
        episode: longest episode [steps].

    Attributes:
        seeds: (N,) int64, with which the next `forward` resets.
        observation, previous: (N, O) float32, now and before the last step.
        reward: (N,) float32, the environment's own.
        terminated, truncated: (N,) bool, as the environment says of the last step.
        info: by name (N, *shape) float32; 0 where the environment says nothing.
    """

    def __init__(self, make: Callable[..., Any], num_worlds: int, found: Survey, *, name: str, episode: int) -> None:
        self.num_worlds, self.device = num_worlds, torch.device("cpu")
        self.bad = torch.zeros(num_worlds, dtype=torch.bool)
        self._name, self._parts, self._actions, self._wanted = name, found.parts, found.actions, found.wanted
        self.info = {name: torch.zeros(num_worlds, *shape) for name, shape in found.infos.items()}
        with self._blamed():
            self._vector = self._opened(make, num_worlds)
        self.seeds = torch.zeros(num_worlds, dtype=torch.int64)
        self.action = torch.zeros(num_worlds, found.actions.size)
        self._taken = torch.zeros(num_worlds, episode, found.actions.size)
        self._steps = torch.zeros(num_worlds, dtype=torch.int64)
        self.observation = torch.zeros(num_worlds, found.size)
        self.previous = self.observation.clone()
        self.reward = torch.zeros(num_worlds)
        self.terminated, self.truncated = self.bad.clone(), self.bad.clone()

    def _opened(self, make: Callable[..., Any], num_worlds: int) -> Any:
        """N worlds as Gymnasium's vector API has them."""
        shapes = {name: tuple(kept.shape[1:]) for name, kept in self.info.items()}
        return Together(make, num_worlds, shapes, self._wanted)

    def step(self, substeps: int) -> None:
        """One step under `action` (N, A)."""
        each = torch.arange(self.num_worlds)
        self._keep(each)
        actions = self._actions.taken(self.action.nan_to_num())
        with self._blamed():
            seen, reward, terminated, truncated, info = self._vector.step(actions)
            self.previous.copy_(self.observation)
            self._see(seen, info, each)
        self.reward.copy_(torch.from_numpy(np.asarray(reward, np.float32)))
        self.terminated.copy_(torch.from_numpy(terminated))
        self.truncated.copy_(torch.from_numpy(truncated))
        finite = self.observation.isfinite().all(1) & self.reward.isfinite() & self.action.isfinite().all(1)
        self.bad = ~finite
        self.reward.masked_fill_(self.bad, 0.0)
        self.observation[self.bad] = self.previous[self.bad]

    def _keep(self, each: Tensor) -> None:
        """Remember `action` in each world (N,)."""
        if int(self._steps.max()) >= self._taken.shape[1]:  # the caller put off a time-out
            self._taken = torch.cat((self._taken, torch.zeros_like(self._taken)), dim=1)
        self._taken[each, self._steps] = self.action
        self._steps += 1

    def reset(self, worlds: Tensor) -> None:
        """Nothing to do before `forward`, which resets these worlds with their `seeds`."""

    def forward(self, worlds: Tensor) -> None:
        """Begin an episode in these worlds (k,)."""
        if not len(worlds):
            return
        mask = np.zeros(self.num_worlds, dtype=np.bool_)
        mask[worlds.numpy()] = True
        seeds: list[int | None] = [*self.seeds.tolist()]
        with self._blamed():
            seen, info = self._vector.reset(seed=seeds, options={"reset_mask": mask})
            self._see(seen, info, worlds)
        self.previous[worlds] = self.observation[worlds]
        self._steps[worlds] = 0
        for value in (self.reward, self.terminated, self.truncated, self.action):
            value[worlds] = 0

    def memory(self) -> dict[str, Tensor]:
        return {
            "seeds": self.seeds,
            "taken": self._taken,
            "steps": self._steps,
            "observation": self.observation,
        }

    def load_state_dict(self, saved: Mapping[str, Tensor]) -> None:
        self._taken = torch.zeros_like(saved["taken"])
        super().load_state_dict(saved)
        kept = {name: value.clone() for name, value in self.memory().items()}
        self.forward(torch.arange(self.num_worlds))
        self._replay(kept["taken"], kept["steps"])
        for name, value in self.memory().items():
            value.copy_(kept[name])

    def _replay(self, taken: Tensor, steps: Tensor) -> None:
        """Replay each world's current episode from its start: the first `steps` (N,) of its actions (N, T, A)."""
        for world, env in enumerate(self._vector.envs):
            for action in self._actions.taken(taken[world, : int(steps[world])]):
                with self._blamed():
                    env.step(action)
                self._replayed()

    def _replayed(self) -> None:
        if self.after_replayed_step is not None:
            self.after_replayed_step()

    def check(self, task: str) -> None:
        """Nothing here runs out of room."""

    def picture(self, world: int) -> np.ndarray | None:
        """(H, W, 3) uint8, as the environment draws it; None where it does not."""
        if self._vector.render_mode != "rgb_array":
            return None
        with self._blamed():
            try:
                picture = self._vector.envs[world].render()
            except NotImplementedError:  # by the base class: it cannot draw after all
                return None
        return picture if isinstance(picture, np.ndarray) and picture.ndim == 3 else None

    def _see(self, seen: Any, info: Mapping[str, Any], worlds: Tensor) -> None:
        rows = np.concatenate([part.rows(seen) for part in self._parts], axis=1)
        self.observation[worlds] = torch.from_numpy(rows)[worlds]
        for name, kept in self.info.items():
            values = info.get(name)
            if values is None:
                kept[worlds] = 0.0
                continue
            array = torch.from_numpy(np.asarray(values, dtype=np.float32).reshape(kept.shape))
            kept[worlds] = array.nan_to_num()[worlds]

    @contextmanager
    def _blamed(self) -> Iterator[None]:
        """Raises TaskError for whatever an environment raises."""
        try:
            yield
        except EurekaError:
            raise
        except (Exception, SystemExit) as error:
            raise TaskError(f"The environment `{self._name}` failed: {told_where(error)}") from error
