import math

import mujoco
import pytest
import torch

from openeureka.suite.isaac.ballbalance import BallBalance
from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.registry import make


@pytest.fixture
def env() -> BatchedEnv:
    simulation = make("ballbalance", worlds=4, threads=1)
    simulation.reset()
    return simulation


def place_ball(env: BatchedEnv, *, x: float, y: float, z: float) -> None:
    worlds = torch.arange(env.num_worlds)
    env.task.qpos[:, 13:16] = torch.tensor([x, y, z])
    env.task.qvel[:, 12:15] = 0.0
    env.sim.forward(worlds)


def idle(env: BatchedEnv, steps: int) -> dict:
    for _ in range(steps):
        step = env.step(torch.zeros(env.num_worlds, 3))
    return dict(step.state)


def test_the_original_variables_have_their_names_and_shapes():
    shapes = {variable.name: variable.shape for variable in BallBalance.spec.variables if variable.use == "raw"}
    shapes.pop("num_envs")
    assert shapes == {
        "obs_buf": (24,),
        "ball_positions": (3,),
        "ball_linvels": (3,),
        "dof_positions": (6,),
        "dof_velocities": (6,),
        "sensor_forces": (3, 3),
        "sensor_torques": (3, 3),
    }


def test_the_model_has_the_specified_masses_and_joints():
    model = BallBalance.compile_model()
    mass = {model.body(i).name: model.body_mass[i] for i in range(1, model.nbody)}
    assert mass["tray"] == pytest.approx(1.571, abs=1e-3)
    assert mass["ball"] == pytest.approx(0.838, abs=1e-3)
    legs = [f"{part}_leg{i}" for i in range(3) for part in ("upper", "lower")]
    assert all(mass[leg] == pytest.approx(0.486, abs=1e-3) for leg in legs)
    hinges = [model.joint(i) for i in range(model.njnt) if model.jnt_type[i] == mujoco.mjtJoint.mjJNT_HINGE]
    assert [hinge.name for hinge in hinges] == [f"{part}_leg_joint{i}" for i in range(3) for part in ("upper", "lower")]
    assert [math.degrees(limit) for hinge in hinges for limit in hinge.range] == pytest.approx([-45, 45, -70, 90] * 3)
    # 18 velocities - 6 of the ball - 9 rows of three pinned feet = 3: height, roll and pitch of the tray
    assert model.nv == 18 and model.neq == 3


def test_legs_stand_where_the_specification_puts_them(env: BatchedEnv):
    model, data = env.sim.snapshot(0)
    assert data.body("tray").xpos[2] == pytest.approx(0.5591, abs=1e-4)
    for i in range(3):
        direction = [math.cos(2 * math.pi * i / 3), math.sin(2 * math.pi * i / 3)]
        knee = data.body(f"lower_leg{i}")
        foot = knee.xpos + knee.xmat.reshape(3, 3) @ [0, 0, 0.36]
        assert knee.xpos[:2] == pytest.approx([0.1454 * c for c in direction], abs=1e-4)
        assert foot == pytest.approx([0.4 * direction[0], 0.4 * direction[1], 0.02], abs=1e-6)
    assert model.opt.timestep == pytest.approx(0.005)


def test_the_ball_is_thrown_inwards_and_down():
    env = make("ballbalance", worlds=2000, threads=1)
    env.reset()
    position, velocity = env.task.qpos[:, 13:16], env.task.qvel[:, 12:18]
    distance = position[:, :2].norm(dim=-1)
    assert 0.001 <= float(distance.min()) < 0.005 and 0.49 < float(distance.max()) <= 0.5001
    assert 1.0 <= float(position[:, 2].min()) < 1.01 and 1.99 < float(position[:, 2].max()) <= 2.0
    assert torch.all(velocity[:, 2] == -5.0) and not velocity[:, 3:].any()
    inwards = -(position[:, :2] * velocity[:, :2]).sum(-1) / distance
    speed = velocity[:, :2].norm(dim=-1)
    assert torch.allclose(inwards, speed, atol=1e-5)
    share = speed / (5.0 * (distance - 0.001) / 0.499)
    assert float(share.max()) <= 1.001
    # Uniform on [0, 1) with 2000 draws: standard error of the mean 0.0065.
    assert float(share.mean()) == pytest.approx(0.5, abs=0.03)
    assert not env.task.qpos[:, 7:13].any() and not env.task.ctrl.any()


def test_actions_move_the_knee_targets_by_a_fifth_of_a_radian_up_to_the_limits(env: BatchedEnv):
    env.step(torch.tensor([[1.0, -0.5, 0.0]]).repeat(4, 1))
    assert torch.allclose(env.task.ctrl[0], torch.tensor([0.2, -0.1, 0.0]))
    for _ in range(10):
        env.step(torch.tensor([[1.0, -1.0, 5.0]]).repeat(4, 1))
    assert torch.allclose(env.task.ctrl[0], torch.tensor([math.pi / 2, math.radians(-70), math.pi / 2]))


def test_sensors_feel_the_weight_of_a_ball_at_rest(env: BatchedEnv):
    place_ball(env, x=0.1, y=0.05, z=0.669)
    state = idle(env, 100)
    x, y, z = state["ball_positions"][0].tolist()
    weight = 0.8378 * 9.81
    assert z == pytest.approx(0.669, abs=2e-3)
    assert torch.allclose(state["sensor_forces"][0], torch.tensor([0.0, 0.0, -weight]).repeat(3, 1), atol=0.05)
    # About rim point (0.4, 0): (x - 0.4, y, .) x (0, 0, -weight) = (-y weight, (x - 0.4) weight, 0)
    expected = torch.tensor([-y * weight, (x - 0.4) * weight, 0.0])
    assert torch.allclose(state["sensor_torques"][0, 0], expected, atol=0.05)
    assert torch.allclose(state["obs_buf"][0, [15, 18, 21]], expected / 20.0, atol=0.003)
    # The three points see the same force; the mean of their torques is the one about the tray's centre.
    assert torch.allclose(state["sensor_torques"][0].mean(0), torch.tensor([-y, x, 0.0]) * weight, atol=0.05)


def test_no_contact_means_no_wrench(env: BatchedEnv):
    state = idle(env, 1)
    assert not state["sensor_forces"].any() and not state["sensor_torques"].any()


def test_friendly_variables_describe_table_and_ball(env: BatchedEnv):
    place_ball(env, x=0.3, y=-0.1, z=1.2)
    half = 0.05  # a roll of 0.1 rad about x
    env.task.qpos[:, 0:2] = torch.tensor([0.1, 0.2])
    env.task.qpos[:, 3:7] = torch.tensor([math.cos(half), math.sin(half), 0.0, 0.0])
    state = env.task.compute_state()
    assert torch.allclose(state["table_angles"][0], torch.tensor([0.1, 0.0]), atol=1e-6)
    assert float(state["table_tilt"][0]) == pytest.approx(0.1, abs=1e-6)
    assert torch.allclose(state["ball_offset"][0], torch.tensor([0.2, -0.3]))
    assert float(state["ball_height"][0]) == pytest.approx(1.2)
    assert torch.allclose(state["rest_position"][0], torch.tensor([0.0, 0.0, 0.6691]), atol=1e-4)
    assert torch.equal(state["ball_position"], state["ball_positions"])


def test_the_episode_fails_when_the_ball_falls_below_fifteen_centimetres(env: BatchedEnv):
    state = {"ball_positions": torch.tensor([[0.0, 0.0, 0.1499], [0.0, 0.0, 0.1501]])}
    assert env.task.terminated(state).tolist() == [True, False]
    assert env.task.sparse_reward(state).tolist() == [0.0, 1.0]


def test_fitness_is_the_length_of_finished_episodes(env: BatchedEnv):
    env.task.progress[:] = torch.tensor([10, 499, 20, 30])
    score = env.task.fitness({}, torch.tensor([True, True, False, False]))
    assert float((score.value * score.weight).sum() / score.weight.sum()) == 254.5


@pytest.mark.parametrize(("noise", "low", "high"), [(0.0, 170.0, 290.0), (1.0, 80.0, 130.0)])
def test_idle_and_random_tables_keep_the_ball_as_long_as_the_specification_says(noise: float, low: float, high: float):
    """About 210 and 110 steps. Over 64 throws the standard errors are about 19 and 5."""
    env = make("ballbalance", worlds=64, threads=0)
    env.reset()
    generator = torch.Generator().manual_seed(0)
    first = torch.zeros(64)
    while not first.all():  # after 499 steps at the latest
        step = env.step(noise * torch.randn(64, 3, generator=generator))
        ended = step.done & (first == 0)
        first[ended] = step.episode_length[ended].float()
    assert low < float(first.mean()) < high


def test_feet_stay_in_place_under_random_control():
    env = make("ballbalance", worlds=32, threads=0)
    feet = [env.sim.model.body(f"lower_leg{i}").id for i in range(3)]
    position, rotation = env.sim.bind("xpos"), env.sim.bind("xmat")
    env.reset()
    pins = position[:, feet] + 0.36 * rotation[:, feet].view(-1, 3, 3, 3)[..., 2]
    generator = torch.Generator().manual_seed(0)
    for _ in range(100):
        env.step(torch.randn(32, 3, generator=generator))
        now = position[:, feet] + 0.36 * rotation[:, feet].view(-1, 3, 3, 3)[..., 2]
        assert float((now - pins).norm(dim=-1).max()) < 0.1
