"""Fakes of mjlab and Isaac Lab: modules with their names, with only the parts that the server uses.

Modelled on the originals' source: `ManagerBasedRlEnv` of mjlab, `ManagerBasedRLEnv` and `DirectRLEnv` of Isaac Lab. A
step has the same order: terminations, rewards, resets of worlds that are done, observations. `install()` makes the
fakes importable.
"""

import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

END, LIMIT = 1.5, 20
"""Distance from the middle at which a cart falls off [m], and length of an episode [steps]."""


def data(env):
    import torch

    n, turn = env.num_envs, torch.zeros(env.num_envs, 4)
    turn[:, 0] = 1.0  # w, x, y, z

    class Data:
        joint_names = ("slide",)
        joint_pos = property(lambda _: env.place[:, None])
        joint_vel = property(lambda _: env.speed[:, None])
        root_link_pos_w = property(
            lambda _: torch.nn.functional.pad(env.place[:, None], (0, 2)) + env.scene.env_origins
        )
        root_link_quat_w = property(lambda _: turn)
        root_link_lin_vel_b = property(lambda _: torch.zeros(n, 0))  # empty: the state table leaves it out

        @property
        def actuator_force(self):
            raise NotImplementedError

    return Data()


class Base:
    """N carts. `step` itself resets the worlds that are done, as in the suites."""

    step_dt, device, max_episode_length = 0.1, "cpu", LIMIT

    def __init__(self, cfg, **_):
        import torch

        self.cfg, self.num_envs = cfg, cfg.scene.num_envs
        self.place, self.speed = torch.zeros(2, self.num_envs).unbind()
        self.episode_length_buf = torch.zeros(self.num_envs, dtype=torch.int64)
        self.scene = SimpleNamespace(
            env_origins=torch.arange(self.num_envs * 3.0).view(-1, 3), sensors={}, write_data_to_sim=lambda: None
        )
        robot = SimpleNamespace(data=data(self), joint_names=["slide"])
        self.scene.__dict__.update(cfg.owners(robot))
        self.sim = SimpleNamespace(forward=lambda: None)
        self.single_action_space = SimpleNamespace(shape=(1,))

    @property
    def unwrapped(self):
        return self

    def move(self, action):
        self.speed = self.speed + self.step_dt * (3.0 * action[:, 0] - self.speed)
        self.place = self.place + self.step_dt * self.speed
        self.episode_length_buf += 1

    def dones(self):
        return self.place.abs() > END, self.episode_length_buf >= LIMIT

    def _reset_idx(self, worlds):
        import torch

        self.place[worlds] = torch.rand(len(worlds)) - 0.5
        self.speed[worlds] = 0.0
        self.episode_length_buf[worlds] = 0

    def begin(self, seed, worlds):
        import torch

        if seed is not None:
            torch.manual_seed(seed)
        self._reset_idx(torch.arange(self.num_envs) if worlds is None else worlds)


class ManagerBased(Base):
    def __init__(self, cfg, **given):
        super().__init__(cfg, **given)
        import torch

        zero = torch.zeros(self.num_envs, 1)
        self.action_manager = SimpleNamespace(action=zero, prev_action=zero)
        self.command_manager = SimpleNamespace(active_terms=["mark"], get_command=lambda _: 0.5 * torch.ones_like(zero))
        self.reward_manager = SimpleNamespace(compute=self.paid)

    def paid(self, dt):
        return sum(term.func(self, **term.params) * term.weight * dt for term in self.cfg.rewards.values())

    def step(self, action):
        manager = self.action_manager
        manager.prev_action, manager.action = manager.action, action
        self.move(action)
        self.reset_terminated, self.reset_time_outs = self.dones()
        reward = self.reward_manager.compute(dt=self.step_dt)
        done = (self.reset_terminated | self.reset_time_outs).nonzero().squeeze(-1)
        if len(done):
            self._reset_idx(done)
        return self.seen(), reward, self.reset_terminated, self.reset_time_outs, {}

    def reset(self, *, seed=None, env_ids=None, options=None):
        self.begin(seed, env_ids)
        return self.seen(), {}

    def seen(self):
        import torch

        return {"policy": torch.stack((self.place, self.speed), dim=1), "critic": self.place[:, None]}


class Direct(Base):
    def __init__(self, cfg, **given):
        super().__init__(cfg, **given)
        import torch

        self.actions = torch.zeros(self.num_envs, 1)
        self.gap = self.place.clone()
        self.reward_buf = self.place.clone()

    def step(self, action):
        self.actions = action.clone()
        self.move(action)
        self.reset_terminated, self.reset_time_outs = self.dones()
        self.gap = (self.place - 0.5).abs()
        self.reward_buf = self._get_rewards()
        done = (self.reset_terminated | self.reset_time_outs).nonzero().squeeze(-1)
        if len(done):
            self._reset_idx(done)
        return self._get_observations(), self.reward_buf, self.reset_terminated, self.reset_time_outs, {}

    def reset(self, seed=None, options=None):
        self.begin(seed, None)
        return self._get_observations(), {}

    def _get_rewards(self):
        return -self.gap

    def _get_observations(self):
        import torch

        return {"policy": torch.stack((self.place, self.speed), dim=1)}


class Term(SimpleNamespace):
    """Fake of `RewardTermCfg`."""

    def __init__(self, func, weight, params=None):
        super().__init__(func=func, weight=weight, params=params or {})


def configured(owners):
    term = Term(lambda env: -(env.place - 0.5).abs(), 2.0)
    return SimpleNamespace(scene=SimpleNamespace(num_envs=1), owners=owners, rewards={"near": term}, seed=None)


def of_mjlab(robot):
    return {"entities": {"robot": robot}}


def of_isaaclab(robot):
    return {"articulations": {"robot": robot}, "rigid_objects": {}}


def faked(place, fakes):
    """Returns a PYTHONPATH that makes a Python install the fakes of a module of this directory when it starts."""
    code = f"import sys; sys.path.append({str(Path(__file__).parent)!r}); import {fakes}; {fakes}.install()"
    (place / "sitecustomize.py").write_text(code)
    return str(place)


def install(modules=sys.modules):
    """Put the fakes into `sys.modules`, where `import` finds them, or into another mapping."""

    def made(name, **found):
        modules[name] = ModuleType(name)
        modules[name].__dict__.update(found)

    made("mjlab")
    made("mjlab.tasks")
    made("mjlab.tasks.registry", list_tasks=lambda: ["Fake-Carts"], load_env_cfg=lambda _: configured(of_mjlab))
    made("mjlab.envs", ManagerBasedRlEnv=lambda cfg, device: ManagerBased(cfg))
    made("mjlab.managers")
    made("mjlab.managers.reward_manager", RewardTermCfg=Term)

    class AppLauncher:
        def __init__(self, headless):
            print("[INFO] an application starts")

    def parsed(name, device, num_envs):
        return configured(of_isaaclab)

    kinds = {"Fake-Carts": ManagerBased, "Fake-Carts-Direct": Direct}
    made("isaaclab", __version__="2.3.2")
    made("isaaclab.app", AppLauncher=AppLauncher)
    made("isaaclab.managers", RewardTermCfg=Term)
    made("isaaclab_tasks")
    made("isaaclab_tasks.utils", parse_env_cfg=parsed)
    made("gymnasium", make=lambda name, cfg: kinds[name](cfg))
