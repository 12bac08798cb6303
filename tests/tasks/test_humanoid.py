"""Humanoid: its body, joint forces, observation and scores. test_ant.py tests what it shares with Ant."""

import math

import mujoco
import numpy as np
import pytest
import torch
from torch import Tensor

from openeureka.suite.isaac.humanoid import Humanoid
from openeureka.tasks.env import BatchedEnv

LEG = ["hip_x", "hip_z", "hip_y", "knee", "ankle_y", "ankle_x"]
ARM = ["shoulder1", "shoulder2", "elbow"]
DOFS = [
    *("abdomen_z", "abdomen_y", "abdomen_x"),
    *(f"{side}_{joint}" for side in ("right", "left") for joint in LEG),
    *(f"{side}_{joint}" for side in ("right", "left") for joint in ARM),
]
KNEE = DOFS.index("right_knee")


def make(worlds: int = 2) -> BatchedEnv:
    env = BatchedEnv(Humanoid, worlds=worlds, threads=1)
    env.reset()
    return env


def state_of(**values: float | list[float]) -> dict[str, Tensor]:
    """What the rewards read: one world that stands still at the origin, except for `values`."""
    rest = {
        "potentials": 0.0,
        "prev_potentials": 0.0,
        "torso_height": 1.3,
        "heading_proj": 1.0,
        "up_proj": 1.0,
        "actions": [0.0] * 21,
        "dof_vel": [0.0] * 21,
        "dof_pos_scaled": [0.0] * 21,
    }
    return {**{name: torch.tensor([value]) for name, value in (rest | values).items()}, "dof_vel_scale": 0.1}


def test_masses_are_those_of_the_original():
    model = Humanoid.compile_model()
    assert model.body_mass.sum() == pytest.approx(40.84, abs=5e-3)
    middle = {
        "torso": 5.854,
        "head": 3.054,
        "lower_waist": 2.262,
        "pelvis": 6.616,
    }
    sides = {
        "thigh": 4.752,
        "shin": 2.756,
        "foot": 1.131,
        "upper_arm": 1.661,
        "lower_arm": 0.961,
        "hand": 0.268,
    }
    both = {f"{side}_{name}": mass for side in ("right", "left") for name, mass in sides.items()}
    for body, mass in (middle | both).items():
        assert model.body(body).mass[0] == pytest.approx(mass, abs=1e-3)


def test_joints_and_motors_come_in_the_original_order():
    model = Humanoid.compile_model()
    assert [model.joint(i).name for i in range(1, 22)] == DOFS
    assert [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]] == DOFS
    leg, arm = [45, 45, 135, 90, 22.5, 22.5], [67.5, 67.5, 45]
    assert model.actuator_gear[:, 0].tolist() == [67.5] * 3 + leg * 2 + arm * 2


def test_both_sides_have_equal_limits_springs_and_dampers():
    model = Humanoid.compile_model()
    for name in LEG + ARM:
        right, left = model.joint(f"right_{name}"), model.joint(f"left_{name}")
        for field in ("range", "stiffness", "damping", "armature"):
            np.testing.assert_array_equal(getattr(right, field), getattr(left, field))
    knee = model.joint("left_knee")
    np.testing.assert_allclose(np.degrees(knee.range), [-160, 2])
    assert knee.stiffness[0] == 5 and knee.damping[0] == 0.1 and knee.armature[0] == 0.007
    np.testing.assert_allclose(np.degrees(model.joint("abdomen_y").range), [-75, 30])


def test_left_axes_mirror_the_right_ones_except_at_the_ankle():
    model = Humanoid.compile_model()
    assert model.joint("right_hip_x").axis.tolist() == [1, 0, 0]
    assert model.joint("left_hip_x").axis.tolist() == [-1, 0, 0]
    np.testing.assert_allclose(model.joint("left_shoulder1").axis, np.array([-2, 1, -1]) / math.sqrt(6))
    np.testing.assert_array_equal(model.joint("left_ankle_x").axis, model.joint("right_ankle_x").axis)


def test_it_starts_above_the_floor_without_touching_itself():
    env = make()
    _, data = env.sim.snapshot(0)
    assert data.ncon == 0
    # Soles start 5.5 cm above the ground when the joints are at zero.
    model = Humanoid.compile_model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0
    assert data.body("right_foot").xpos[2] - 0.027 == pytest.approx(0.055, abs=2e-3)


def test_legs_collide_with_each_other_but_not_with_their_neighbours():
    model = Humanoid.compile_model()
    data = mujoco.MjData(model)
    for side in ("right", "left"):
        data.joint(f"{side}_hip_x").qpos[0] = math.radians(15)
    mujoco.mj_forward(model, data)
    touching = {frozenset(model.body(model.geom_bodyid[g]).name for g in contact.geom) for contact in data.contact}
    assert frozenset({"right_shin", "left_shin"}) in touching
    assert frozenset({"right_thigh", "right_shin"}) not in touching


def test_joint_forces_are_motor_spring_and_damper():
    env = make()
    action = torch.zeros(2, 21)
    action[:, KNEE] = -0.5
    state = env.step(action).state
    # Motor 90 N m, spring 5 N m/rad, damper 0.1 N m s/rad.
    expected = -45 - 5 * state["dof_pos"][:, KNEE] - 0.1 * state["dof_vel"][:, KNEE]
    torch.testing.assert_close(state["dof_force_tensor"][:, KNEE], expected, atol=1e-3, rtol=0)


def test_resets_start_near_the_straight_pose():
    state = make(worlds=256).current_state()
    assert torch.equal(state["root_states"][:, :7], torch.tensor([0, 0, 1.34, 0, 0, 0, 1.0]).repeat(256, 1))
    angles, rates = state["dof_pos"], state["dof_vel"]
    assert -0.2 <= angles.min() < -0.19
    assert angles[:, KNEE].max() == pytest.approx(math.radians(2))  # its upper limit
    assert 0.19 < angles[:, DOFS.index("abdomen_z")].max() <= 0.2
    assert -0.1 <= rates.min() < -0.09 and 0.09 < rates.max() <= 0.1


def test_falling_costs_one_but_not_fitness():
    task = make(1).task
    fallen = state_of(potentials=2.0, torso_height=0.79)
    assert task.terminated(fallen).tolist() == [True]
    assert task.terminated(state_of(torso_height=0.81)).tolist() == [False]
    assert task.human_reward(fallen).tolist() == [-1.0]
    assert task.sparse_reward(fallen).tolist() == [2.0]


def test_random_play_is_sound_and_lasts_as_long_as_in_the_original():
    env = make(worlds=64)
    generator = torch.Generator().manual_seed(0)
    lengths: list[int] = []
    for _ in range(80):
        step = env.step(2 * torch.rand(64, 21, generator=generator) - 1)
        lengths += step.episode_length[step.done].tolist()
    assert env.bad_total == 0
    assert 19 <= np.median(lengths) <= 36
