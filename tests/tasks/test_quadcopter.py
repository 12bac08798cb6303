import math

import mujoco
import pytest
import torch

from openeureka.suite.isaac.quadcopter import Quadcopter
from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.registry import make


@pytest.fixture
def env() -> BatchedEnv:
    simulation = make("quadcopter", worlds=3, threads=1)
    simulation.reset()
    return simulation


def pose(env: BatchedEnv, *, quat_wxyz: list[float], body_rates: list[float]) -> dict:
    """State of all worlds in this orientation, turning with these body-frame rates."""
    env.task.qpos[:, 3:7] = torch.tensor(quat_wxyz)
    env.task.qvel[:, 3:6] = torch.tensor(body_rates)
    env.sim.forward(torch.arange(env.num_worlds))
    return env.task.compute_state()


def test_the_original_variables_have_their_names_and_shapes():
    shapes = {variable.name: variable.shape for variable in Quadcopter.spec.variables if variable.use == "raw"}
    shapes.pop("num_envs")
    assert shapes == {
        "obs_buf": (21,),
        "root_positions": (3,),
        "root_quats": (4,),
        "root_linvels": (3,),
        "root_angvels": (3,),
        "dof_positions": (8,),
    }


def test_the_model_has_the_specified_mass_bodies_and_joints():
    model = Quadcopter.compile_model()
    assert model.body_mass.sum() == pytest.approx(0.2515, abs=1e-4)
    names = [model.body(i).name for i in range(1, model.nbody)]
    assert names == ["chassis", *(f"rotor{part}{i}" for i in range(4) for part in ("_arm", ""))]
    joints = [model.joint(i) for i in range(1, model.njnt)]
    assert [joint.name for joint in joints] == [f"rotor_{axis}{i}" for i in range(4) for axis in ("pitch", "roll")]
    assert [math.degrees(limit) for joint in joints for limit in joint.range] == pytest.approx([-30, 30] * 8)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    # 0.1025 m to the arm and 0.0425 m on to the rotor, along the diagonal
    assert data.body("rotor0").xpos == pytest.approx([0.145 * math.sqrt(0.5), 0.145 * math.sqrt(0.5), 1.0])


def test_it_hovers_for_five_seconds_on_a_quarter_of_its_weight_per_rotor():
    model = Quadcopter.compile_model()
    data = mujoco.MjData(model)
    data.ctrl[8:] = model.body_mass.sum() * 9.81 / 4
    assert data.ctrl[8] == pytest.approx(0.617, abs=1e-3)
    mujoco.mj_step(model, data, 1000)
    assert data.qpos[:3] == pytest.approx([0, 0, 1], abs=1e-3)
    assert abs(data.qpos[7:]).max() < 1e-3


def test_episodes_start_level_at_rest_and_without_thrust():
    env = make("quadcopter", worlds=2000, threads=1)
    env.reset()
    qpos, ctrl = env.task.qpos, env.task.ctrl
    ranges = torch.tensor([[-1.5, 1.5], [-1.5, 1.5], [0.8, 2.5], *[[-0.2, 0.2]] * 8])
    values = torch.cat((qpos[:, :3], qpos[:, 7:]), dim=-1)
    assert torch.all(values.min(0).values >= ranges[:, 0]) and torch.all(values.max(0).values <= ranges[:, 1])
    assert torch.allclose(values.min(0).values, ranges[:, 0], atol=0.02)
    assert torch.allclose(values.max(0).values, ranges[:, 1], atol=0.02)
    assert torch.equal(qpos[:, 3:7], torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(2000, 1))
    assert not env.task.qvel.any() and not ctrl[:, 8:].any()
    assert torch.equal(ctrl[:, :8], qpos[:, 7:])


def test_actions_integrate_rotor_targets_and_thrust_within_their_limits(env: BatchedEnv):
    start = env.task.ctrl[:, :8].clone()
    action = torch.cat((torch.full((8,), 0.5), torch.tensor([1.0, 0.25, -1.0, 0.0])))
    env.step(action.repeat(3, 1))
    # 0.01 s * 8 pi rad/s * 0.5 = 0.1257 rad; 0.01 s * 200 N/s = 2 N at full action
    assert torch.allclose(env.task.ctrl[:, :8], start + 0.12566, atol=1e-4)
    assert torch.allclose(env.task.ctrl[:, 8:], torch.tensor([2.0, 0.5, 0.0, 0.0]).repeat(3, 1))
    for _ in range(6):
        env.step(action.repeat(3, 1))
    assert torch.allclose(env.task.ctrl[:, :8], torch.tensor(math.radians(30)))
    assert torch.allclose(env.task.ctrl[:, 8:], torch.tensor([2.0, 2.0, 0.0, 0.0]).repeat(3, 1))


def test_thrust_pushes_along_the_axis_of_the_tilted_rotors(env: BatchedEnv):
    worlds = torch.arange(3)
    env.task.qpos[:, 7:] = 0.0
    env.task.ctrl[:, :8] = 0.0
    env.sim.forward(worlds)
    full = torch.cat((torch.zeros(8), torch.ones(4))).repeat(3, 1)
    state = env.step(full).state
    # (4 * 2 N - 2.468 N) / 0.2515 kg = 22.0 m/s^2 over 0.01 s, a little less as the rotor arms yield
    assert torch.allclose(state["root_linvels"], torch.tensor([0.0, 0.0, 0.220]).repeat(3, 1), atol=2e-3)

    env.reset()
    tilt = torch.zeros(8)
    tilt[1], tilt[5] = 0.5, -0.5  # rolls of the opposite rotors 0 and 2: their thrusts lean the same way
    env.task.qpos[:, 7:] = tilt
    env.task.ctrl[:, :8] = tilt
    env.sim.forward(worlds)
    state = env.step(full).state
    # Rotor 0 points along (1, 1): a roll of 0.5 leans its 2 N by sin 0.5 towards (1, -1) / sqrt 2, rotor 2 likewise.
    momentum = 2 * 2.0 * math.sin(0.5) * 0.01
    sideways = state["root_linvels"][:, :2] @ torch.tensor([math.sqrt(0.5), -math.sqrt(0.5)])
    assert torch.allclose(sideways, torch.tensor(momentum / 0.2515), rtol=0.05)


def test_quaternions_are_xyzw_and_rates_are_in_the_world_frame(env: BatchedEnv):
    root = math.sqrt(0.5)
    state = pose(env, quat_wxyz=[root, 0.0, 0.0, root], body_rates=[1.0, 0.0, 2.0])  # 90 degrees about z
    assert torch.allclose(state["root_quats"][0], torch.tensor([0.0, 0.0, root, root]))
    assert torch.allclose(state["root_angvels"][0], torch.tensor([0.0, 1.0, 2.0]), atol=1e-6)
    assert float(state["up_proj"][0]) == pytest.approx(1.0)
    assert float(state["yaw_rate"][0]) == pytest.approx(2.0)


def test_up_proj_is_the_cosine_of_the_tilt(env: BatchedEnv):
    half = math.radians(30)  # 60 degrees about x
    state = pose(env, quat_wxyz=[math.cos(half), math.sin(half), 0.0, 0.0], body_rates=[0.0, 0.0, 1.0])
    assert float(state["up_proj"][0]) == pytest.approx(0.5)
    assert torch.allclose(state["root_angvels"][0], torch.tensor([0.0, -math.sqrt(0.75), 0.5]), atol=1e-6)


def test_the_episode_fails_too_far_away_or_too_low(env: BatchedEnv):
    positions = torch.tensor([[2.99, 0.0, 1.0], [3.01, 0.0, 1.0], [0.0, 0.0, 0.31], [0.0, 0.0, 0.29], [0.0, 0.0, 4.01]])
    state = {"root_positions": positions, "target_position": torch.tensor([0.0, 0.0, 1.0])}
    assert env.task.terminated(state).tolist() == [False, True, False, True, True]


def test_fitness_is_minus_the_distance_on_every_step(env: BatchedEnv):
    # (3, 4, 0) from the target: 5 m
    state = {
        "root_positions": torch.tensor([[3.0, 4.0, 1.0], [0.0, 0.0, 1.5]]),
        "target_position": torch.tensor([0.0, 0.0, 1.0]),
    }
    assert env.task.score_unit == "m from the target, negated"
    score = env.task.fitness(state, torch.tensor([True, False]))
    assert score.value.tolist() == [-5.0, -0.5] and score.weight.tolist() == [1.0, 1.0]
    assert env.task.sparse_reward(state).tolist() == [-5.0, -0.5]


def test_spin_stays_near_the_original_limit_under_violent_control():
    env = make("quadcopter", worlds=64, threads=0)
    env.reset()
    generator = torch.Generator().manual_seed(0)
    rates = [
        env.step(torch.randn(64, 12, generator=generator).sign()).state["root_angvels"].norm(dim=-1).max()
        for _ in range(200)
    ]
    assert float(torch.stack(rates).max()) < 1.3 * 4 * math.pi
