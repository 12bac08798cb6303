"""Gymnasium's MuJoCo environments with batched physics: model, frame skip and constants are those of an instance."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any, ClassVar

import mujoco
import torch
from torch import Tensor

from ...errors import TaskError
from ...sim import Simulator
from ...tasks.noise import WorldNoise
from ...tasks.task import Recipe, State
from .task import Info, PaidTask

RECIPE = Recipe(hidden=(64, 64), env_steps=2_000_000, worlds=64, horizon=32, epochs=5, minibatches=4)


class LiftedTask(PaidTask):
    """One family of environments; subclasses hold its formulas.

    Gymnasium reads the fields that MuJoCo leaves after a step. After a Runge-Kutta step they, forces included, are
    nearly those of the state that was reached; after an Euler step, those that its last substep began with.
    """

    recipe = RECIPE
    counts_early = True  # in these families, only a failure ends an episode early
    path: ClassVar[str]
    """Path of the model's file."""
    constants: ClassVar[Mapping[str, Any]]
    """What the instance was made with, such as `ctrl_cost_weight`."""
    skipped: ClassVar[int] = 0
    """Number of first positions that the observation leaves out."""
    fields: ClassVar[tuple[str, ...]] = ()
    """Fields of MjData that the family reads besides the state."""
    forces: ClassVar[bool] = False
    """Whether it reads forces, which after a step are still those of its beginning."""
    normal: ClassVar[bool] = False
    """Whether speeds at the start are normally distributed; if not, uniformly, as positions are."""
    lags: ClassVar[bool] = False
    """Whether it reads fields of the state that the last substep began with; `memory` then lists `late`."""

    def __init__(self, sim: Any, noise: WorldNoise) -> None:
        super().__init__(sim, noise)
        self.qpos, self.qvel, self.ctrl = (self.sim.bind(field) for field in ("qpos", "qvel", "ctrl"))
        self.data = {field: self.sim.bind(field) for field in self.fields}
        self.everywhere = torch.ones(self.num_envs, dtype=torch.bool, device=self.device)
        low, high = torch.from_numpy(self.sim.model.actuator_ctrlrange).float().to(self.device).unbind(1)
        self.middle, self.half = (low + high) / 2, (high - low) / 2
        self.start = torch.from_numpy(self.sim.model.qpos0).float().to(self.device)
        self.before = torch.zeros(self.num_envs, self.num_observations, device=self.device)
        self.place_before = torch.zeros(self.num_envs, 2, device=self.device)
        self.late = torch.full_like(self.together(), torch.nan) if self.lags else torch.zeros(0)
        """(N, numbers) `fields` before the last substep, if `lags`; NaN until the first step of an episode."""

    @classmethod
    def fits(cls, env: Any) -> bool:
        """Whether the family's formulas hold for this instance, with the arguments that it was made with."""
        return True

    @classmethod
    def model(cls) -> mujoco.MjSpec:  # pyright: ignore[reportIncompatibleMethodOverride]  static where a class is one task
        spec = mujoco.MjSpec.from_file(cls.path)
        if "cfrc_ext" in cls.fields:  # MuJoCo computes it only for a model with a force sensor
            body = spec.worldbody.first_body()
            body.add_site(name="openeureka")
            kinds = {"type": mujoco.mjtSensor.mjSENS_FORCE, "objtype": mujoco.mjtObj.mjOBJ_SITE}
            spec.add_sensor(name="openeureka", objname="openeureka", **kinds)
        return spec

    @classmethod
    def compile_model(cls) -> mujoco.MjModel:
        """The model with the file's own timestep and integrator."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # MuJoCo warns of outdated syntax in these files
            return cls.model().compile()

    @classmethod
    def simulate(cls, num_worlds: int, device: str, threads: int) -> Simulator:
        """Raises TaskError for a model whose solver no GPU simulator has: Humanoid's."""
        if device != "cpu" and cls.compile_model().opt.solver == mujoco.mjtSolver.mjSOL_PGS:
            raise TaskError(
                f"The model of `{cls.env}` needs the PGS solver, which runs only on the CPU; leave device={device} out."
            )
        return super().simulate(num_worlds, device, threads)

    def apply_action(self, actions: Tensor) -> None:
        self.before.copy_(self.observation())
        self.place_before.copy_(self.place())
        self.ctrl[:] = self.middle + self.half * actions

    def advance(self) -> None:
        if self.lags:
            bad = torch.zeros_like(self.sim.bad)
            if self.substeps > 1:
                self.sim.step(self.substeps - 1)
                bad = self.sim.bad.clone()
            self.late = self.together()
            self.sim.step(1)
            self.sim.bad |= bad
            return
        super().advance()
        if self.forces:
            self.sim.forward(self.everywhere)

    def together(self) -> Tensor:
        """(N, numbers) current values of `fields`, one after the other."""
        return torch.cat([value.flatten(1) for value in self.data.values()], dim=1)

    def read(self, field: str) -> Tensor:
        """(N, ...) what Gymnasium finds in a field after a step, or at the start of an episode."""
        now = self.data[field]
        if not self.lags:
            return now.clone()
        sizes = [value[0].numel() for value in self.data.values()]
        late = dict(zip(self.data, self.late.split(sizes, dim=1), strict=True))[field].view_as(now)
        return torch.where(late.isnan(), now, late)

    def place(self) -> Tensor:
        """(N, 2) position from which speeds are computed [m]."""
        return self.qpos[:, :2].clone()

    def speed(self) -> Tensor:
        """(N, 2) [m/s] over the last step; 0 at the start."""
        moved = (self.place() - self.place_before) / self.control_dt
        return torch.where((self.progress == 0)[:, None], 0.0, moved)

    def effort(self) -> Tensor:
        """(N,) sum of the squares of the controls that were asked for; with a randomised delay, others act."""
        return (self.middle + self.half * self.actions).square().sum(1)

    def previous_observation(self, observation: Tensor) -> Tensor:
        return torch.where((self.progress == 0)[:, None], observation, self.before)

    def info(self) -> Info:
        return {}

    def terminated(self, s: State) -> Tensor:
        return torch.zeros(self.num_envs, dtype=torch.bool, device=self.device)

    def reset(self, worlds: Tensor) -> None:
        self.qpos[worlds], self.qvel[worlds] = self.begin(worlds)
        self.returned.index_fill_(0, worlds, 0.0)
        if self.lags:
            self.late.index_fill_(0, worlds, torch.nan)

    def begin(self, worlds: Tensor) -> tuple[Tensor, Tensor]:
        """Positions (k, nq) and speeds (k, nv) with which these worlds start."""
        noise, size = self.constants["reset_noise_scale"], self.qvel.shape[1]
        places = self.start + self.noise.uniform(worlds, len(self.start), -noise, noise)
        if not self.normal:
            return places, self.noise.uniform(worlds, size, -noise, noise)
        uniform = self.noise.uniform(worlds, size, -1.0 + 1e-6, 1.0 - 1e-6)
        return places, noise * math.sqrt(2.0) * torch.erfinv(uniform)
