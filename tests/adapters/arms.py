"""Fakes of dm_control and ManiSkill: modules with their names, with only the parts that the server uses.

Modelled on the originals' source: `Environment` of `dm_control.rl.control`, `BaseEnv` and `TimeLimitWrapper` of
ManiSkill. `install()` makes the fakes importable.
"""

import sys
from collections import OrderedDict
from types import ModuleType, SimpleNamespace

import numpy as np

LIMIT = 6
"""Length of an episode [steps]."""


class PhysicsError(RuntimeError):
    """As `dm_control.rl.control` raises it."""


class BasePhysics:
    """As `dm_control.mujoco.Physics`."""

    def timestep(self):
        return 0.02


class Physics(BasePhysics):
    def __init__(self):
        self.data = SimpleNamespace(qpos=np.zeros(7 + 1), qvel=np.zeros(6 + 1))
        names = {"joint": ["root", "hinge"], "actuator": ["motor", "winch"]}
        self.model = SimpleNamespace(jnt_type=np.array([0, 3]), nu=2, ncam=0, id2name=lambda i, kind: names[kind][i])

    def height(self):
        """Returns the height of the arm."""
        return self.data.qpos[2]

    def ball(self):
        raise KeyError("ball")

    def distance(self, other):
        raise AssertionError("asked without saying to what")


class Swing:
    """An arm `Task` to swing. It pays a reward."""

    def __init__(self):
        self.random = np.random.RandomState(0)

    def initialize_episode(self, physics):
        """Sets a random height.

        Args:
          physics: of the arm.
        """
        physics.data.qpos[:], physics.data.qvel[:] = 0.0, 0.0
        physics.data.qpos[2] = self.random.uniform(-1.0, 1.0)


class Moment(SimpleNamespace):
    """As `dm_env.TimeStep`."""

    def last(self):
        return self.discount is not None and self.ends


class Environment:
    """An action below -0.9 ends the episode, one above 0.9 breaks the physics."""

    def __init__(self, time_limit=LIMIT * 0.02, random=None):
        assert random == 0
        self.physics, self.task, self._step_limit = Physics(), Swing(), time_limit / 0.02

    def action_spec(self):
        return SimpleNamespace(shape=(2,), minimum=np.array([-1.0, -1e10]), maximum=np.array([3.0, 1e10]))

    def control_timestep(self):
        return 0.02

    def reset(self):
        self.count = 0
        self.task.initialize_episode(self.physics)
        return Moment(reward=None, discount=None, ends=False, observation=self._seen())

    def step(self, action):
        assert action.shape == (2,)
        if action[1] > 0.9:
            raise PhysicsError("BADQACC")
        self.count += 1
        self.physics.data.qpos[2] += action[0]
        over = self.count >= self._step_limit
        fell = action[1] < -0.9 and not over
        return Moment(
            reward=10.0 * self.count, discount=0.0 if fell else 1.0, ends=over or fell, observation=self._seen()
        )

    def _seen(self):
        return OrderedDict(height=np.float64(self.physics.height()), position=self.physics.data.qpos[:3].copy())


SUITE = {"swing": Environment}


def load(domain, task, task_kwargs):
    if task == "old":
        raise AttributeError("'MjModel' object has no attribute 'flex_vertedge'")
    return SUITE[task](**task_kwargs)


class Reach:
    """**Task Description:**
    The objective is to reach a mark.

    **Success Conditions:**
    - it is there
    """

    control_freq, device, single_action_space = 10, "cpu", SimpleNamespace(low=-np.ones(1), high=np.ones(1))

    def __init__(self, num_envs, obs_mode, sim_backend, render_backend, mark=0.5):
        import torch

        assert obs_mode == "state_dict" and render_backend == "none"
        assert num_envs == 1 or sim_backend == "physx_cuda"
        self.num_envs, self.mark, self.unwrapped = num_envs, mark, self
        self.max_episode_steps = LIMIT
        self.place, self.elapsed = torch.zeros(num_envs, 1), torch.zeros(num_envs)
        joint = SimpleNamespace(name="slide")
        self.agent = SimpleNamespace(robot=SimpleNamespace(active_joints=[joint]))

    def reset(self, seed=None, options=None):
        import torch

        which = torch.arange(self.num_envs) if options is None else options["env_idx"]
        draws = [torch.Generator().manual_seed(one) for one in seed or ()]
        drawn = torch.cat([torch.rand(1, generator=draw) for draw in draws]) if draws else torch.rand(len(which))
        self.place[which, 0], self.elapsed[which] = 0.1 * drawn, 0.0
        return self.seen(), {**self.told(), "reconfigure": False}

    def step(self, action):
        import torch

        assert action.shape == (self.num_envs, 1)
        self.place, self.elapsed = self.place + 0.1 * action, self.elapsed + 1
        success, ended = self.told()["success"], self.elapsed >= LIMIT
        reward = torch.arange(self.num_envs) + 10.0 * self.elapsed
        return self.seen(), reward, success, ended, self.told()

    def seen(self):
        mark = self.place * 0.0 + self.mark
        extra = {"goal_pos": mark.expand(-1, 3), "tcp_to_goal_pos": (mark - self.place).expand(-1, 3)}
        return {"agent": {"qpos": self.place.clone(), "qvel": self.place[:, :0]}, "extra": extra}

    def told(self):
        return {"success": self.place[:, 0] > self.mark, "elapsed": self.elapsed.clone()}


def install():
    """Put the fakes where `import` finds them."""

    def made(name, **found):
        sys.modules[name] = ModuleType(name)
        sys.modules[name].__dict__.update(found)

    listed = (("arm", "swing"), ("arm", "old"), ("leg", "kick"))
    made("dm_control", suite=SimpleNamespace(ALL_TASKS=listed, load=load))
    made("dm_control.mujoco", Physics=BasePhysics)
    made("dm_control.rl")
    made("dm_control.rl.control", PhysicsError=PhysicsError)
    made("mujoco", __version__="4.0.0")
    made("mani_skill")
    made("mani_skill.envs")
    made("mani_skill.utils")
    made("mani_skill.utils.registration", REGISTERED_ENVS=dict.fromkeys(("Reach-v1", "Bare-v1", "Blind-v1")))
    made("mani_skill.utils.gym_utils", find_max_episode_steps_value=lambda env: env.max_episode_steps)

    def make(name, **given):
        if name == "Bare-v1":
            raise EOFError("EOF when reading a line")
        if name == "Blind-v1":
            raise RuntimeError("failed to find a rendering device")
        return Reach(**given)

    made("gymnasium", make=make)
