"""Ant: its body, the conventions of its state, its observation and its scores."""

import math

import mujoco
import numpy as np
import pytest
import torch
from torch import Tensor

from openeureka.suite.isaac.ant import Ant
from openeureka.tasks.context import context
from openeureka.tasks.env import BatchedEnv

DT = 0.0166


def make(worlds: int = 4) -> BatchedEnv:
    env = BatchedEnv(Ant, worlds=worlds, threads=1)
    env.reset()
    return env


def placed(env: BatchedEnv, qpos: list[float], qvel: list[float]) -> dict:
    """State of world 0 with a torso pose (7) and velocity (6) set by hand, in MuJoCo's order."""
    task, first = env.task, torch.tensor([0])
    task.qpos[0, :7], task.qvel[0, :6] = torch.tensor(qpos), torch.tensor(qvel)
    env.sim.forward(first)
    return env.current_state()


def test_legs_are_told_by_where_they_are() -> None:
    """Forward is +x and left is +y; the original's names of three legs say otherwise."""
    model = Ant.compile_model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    places = [data.xpos[model.body(foot).id][:2] > 0 for foot in Ant.feet]
    legs = [f"{'front' if ahead else 'back'} {'left' if left else 'right'}" for ahead, left in places]
    assert f"hip and ankle of the {', '.join(legs[:3])} and {legs[3]} leg" in Ant.spec["dof_pos"].meaning


def state_of(**values: float | list[float]) -> dict[str, Tensor]:
    """What the rewards read: one world that stands still at the origin, except for `values`."""
    rest = {
        "potentials": 0.0,
        "prev_potentials": 0.0,
        "torso_height": 0.5,
        "heading_proj": 1.0,
        "up_proj": 1.0,
        "actions": [0.0] * 8,
        "dof_vel": [0.0] * 8,
        "dof_pos_scaled": [0.0] * 8,
    }
    return {**{name: torch.tensor([value]) for name, value in (rest | values).items()}, "dof_vel_scale": 0.2}


def test_masses_are_those_of_the_original():
    model = Ant.compile_model()
    assert model.body_mass.sum() == pytest.approx(0.911, abs=5e-4)
    for body, mass in {"torso": 0.484, "front_left_leg": 0.039, "right_back_foot": 0.068}.items():
        assert model.body(body).mass[0] == pytest.approx(mass, abs=5e-4)


def test_joints_and_motors_come_leg_by_leg_with_their_ranges():
    model = Ant.compile_model()
    names = ["hip_1", "ankle_1", "hip_2", "ankle_2", "hip_3", "ankle_3", "hip_4", "ankle_4"]
    assert [model.joint(i).name for i in range(1, 9)] == names
    assert [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]] == names
    assert model.actuator_gear[:, 0].tolist() == [15.0] * 8
    hip, front, back = (-40, 40), (30, 100), (-100, -30)
    np.testing.assert_allclose(np.degrees(model.jnt_range[1:]), [hip, front, hip, back, hip, back, hip, front])


def test_legs_pass_through_each_other_but_not_through_the_floor():
    model = Ant.compile_model()
    floor = model.geom("floor").id
    for a in range(model.ngeom):
        for b in range(a + 1, model.ngeom):
            collide = (model.geom_contype[a] & model.geom_conaffinity[b]) | (
                model.geom_contype[b] & model.geom_conaffinity[a]
            )
            assert bool(collide) == (a == floor)


def test_root_state_is_in_the_world_frame_with_the_scalar_last():
    half = math.sqrt(0.5)  # a quarter turn to the left
    state = placed(make(), [1, 2, 0.6, half, 0, 0, half], [0, 3, 0, 1, 0, 0])
    # Rolling about the body's x axis, which points along the world's y, is turning about y.
    expected = [1, 2, 0.6, 0, 0, half, half, 0, 3, 0, 0, 1, 0]
    torch.testing.assert_close(state["root_states"][0], torch.tensor(expected), atol=1e-6, rtol=0)
    torch.testing.assert_close(state["heading_vec"][0], torch.tensor([0.0, 1.0, 0.0]), atol=1e-6, rtol=0)
    torch.testing.assert_close(state["up_vec"][0], torch.tensor([0.0, 0.0, 1.0]), atol=1e-6, rtol=0)
    # Horizontal distance to (1000, 0) from (1, 2); facing y, the target is 2 m to the right of 999 m ahead.
    distance = math.hypot(999, 2)
    assert state["potentials"][0].item() == pytest.approx(-distance / DT, rel=1e-6)
    assert state["heading_proj"][0].item() == pytest.approx(-2 / distance, abs=1e-6)


def test_yaw_jumps_at_the_running_direction_as_in_the_original():
    env = make()
    slightly_right = placed(env, [0, 0, 0.6, math.cos(0.05), 0, 0, -math.sin(0.05)], [0] * 6)
    assert slightly_right["obs_buf"][0, 7].item() == pytest.approx(2 * math.pi - 0.1, abs=1e-5)


def test_scaled_angles_are_one_at_the_limits():
    env = make()
    env.task.qpos[0, 7:] = env.task.dof_limits_upper
    env.task.qpos[1, 7:] = env.task.dof_limits_lower
    env.sim.forward(torch.tensor([0, 1]))
    scaled = env.current_state()["dof_pos_scaled"]
    torch.testing.assert_close(scaled[:2], torch.tensor([[1.0] * 8, [-1.0] * 8]))


def test_potentials_grow_by_the_speed_and_start_level():
    env = make()
    state = env.current_state()
    assert torch.equal(state["potentials"], state["prev_potentials"])
    before = state["root_states"][:, 0]
    step = env.step(torch.ones(4, 8))
    speed = (step.state["root_states"][:, 0] - before) / DT
    # Distances of 1000 m / dt have a float32 resolution of 0.004 m/s.
    torch.testing.assert_close(step.score.value, speed, atol=0.008, rtol=0)
    assert env.task.score_unit == "m/s towards the target"  # which is far away along x
    assert step.score.weight.tolist() == [1.0] * 4


def test_potentials_are_level_again_after_a_fall():
    env = make()
    placed(env, [5, 0, 0.2, 1, 0, 0, 0], [0] * 6)
    step = env.step(torch.zeros(4, 8))
    assert step.terminated.tolist() == [True, False, False, False]
    state = env.current_state()
    assert state["potentials"][0] == state["prev_potentials"][0] == pytest.approx(-1000 / DT)


def test_feet_in_the_air_feel_nothing_and_standing_feet_carry_the_weight():
    env = make(worlds=1)
    assert env.current_state()["vec_sensor_tensor"].abs().max() == 0.0
    for _ in range(120):
        state = env.step(torch.zeros(1, 8)).state
    wrenches = state["vec_sensor_tensor"].view(4, 2, 3)
    model, data = env.sim.snapshot(0)
    weight = model.body_mass.sum() * 9.81
    up = 0.0
    for foot, (force, torque) in zip(Ant.feet, wrenches.numpy(), strict=True):
        body = data.body(foot)
        expected_force, expected_torque = _contact_wrench(model, data, body.id)
        frame = body.xmat.reshape(3, 3)
        np.testing.assert_allclose(frame @ force, expected_force, atol=0.02)
        np.testing.assert_allclose(frame @ torque, expected_torque, atol=0.02)
        up += (frame @ force)[2]
    assert up == pytest.approx(weight, rel=0.02)


def _contact_wrench(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> tuple[np.ndarray, np.ndarray]:
    """Sum of MuJoCo's own contact forces on a body and of their moments about its origin, in the world frame."""
    force, torque = np.zeros(3), np.zeros(3)
    for i, contact in enumerate(data.contact):
        if model.geom_bodyid[contact.geom[1]] == body:  # the floor is geom 0, so the foot is the second
            local = np.zeros(6)
            mujoco.mj_contactForce(model, data, i, local)
            on_foot = contact.frame.reshape(3, 3).T @ local[:3]
            force += on_foot
            torque += np.cross(contact.pos - data.xpos[body], on_foot)
    return force, torque


def test_resets_start_near_the_bent_pose():
    env = make(worlds=256)
    state = env.current_state()
    assert torch.equal(state["root_states"][:, :7], torch.tensor([0, 0, 0.44, 0, 0, 0, 1.0]).repeat(256, 1))
    assert not state["root_states"][:, 7:].any()
    hips, ankles = state["dof_pos"][:, ::2], state["dof_pos"][:, 1::2] * torch.tensor([1.0, -1.0, -1.0, 1.0])
    bend = math.radians(30)
    assert -0.2 <= hips.min() < -0.18 and 0.18 < hips.max() <= 0.2
    assert ankles.min() == pytest.approx(bend) and bend + 0.18 < ankles.max() <= bend + 0.2
    rates = state["dof_vel"]
    assert -0.1 <= rates.min() < -0.09 and 0.09 < rates.max() <= 0.1


def test_human_reward_caps_heading_and_drops_upright():
    task = make(1).task
    assert task.human_reward(state_of(heading_proj=0.9, up_proj=0.93)).tolist() == pytest.approx([0.5 + 0.5])


def test_falling_costs_two_but_not_fitness():
    task = make(1).task
    fallen = state_of(potentials=2.0, torso_height=0.3)
    assert task.terminated(fallen).tolist() == [True]
    assert task.terminated(state_of(torso_height=0.32)).tolist() == [False]
    assert task.human_reward(fallen).tolist() == [-2.0]
    assert task.sparse_reward(fallen).tolist() == [2.0]


def test_a_model_reads_the_shared_state_code_but_no_score_or_threshold():
    source = context("ant").source
    assert source.index("class Runner:") < source.index("class Ant(Runner):")
    assert "root_states = root_state(self.qpos, self.qvel)" in source
    for secret in ("fall_height", "posture_reward", "sparse_reward", "0.31", "Recipe"):
        assert secret not in source


def test_random_play_is_sound_and_lasts_as_long_as_in_the_original():
    env = make(worlds=64)
    generator = torch.Generator().manual_seed(0)
    lengths: list[int] = []
    for _ in range(250):
        step = env.step(2 * torch.rand(64, 8, generator=generator) - 1)
        lengths += step.episode_length[step.done].tolist()
    assert env.bad_total == 0
    assert lengths and min(lengths) >= 40
