"""Anymal: its body, the conventions of its state, its observation, what ends an episode and its scores."""

import math

import mujoco
import numpy as np
import pytest
import torch
from torch import Tensor

from openeureka.suite.isaac.anymal import BODIES, DEFAULT_ANGLES, LEGS, Anymal
from openeureka.tasks.context import context
from openeureka.tasks.env import BatchedEnv

HALF = math.sqrt(0.5)


def make(worlds: int = 2) -> BatchedEnv:
    env = BatchedEnv(Anymal, worlds=worlds, threads=1)
    env.reset()
    return env


def placed(env: BatchedEnv, qpos: list[float], qvel: list[float], angles: tuple[float, ...] = DEFAULT_ANGLES) -> dict:
    """State of world 0 with base pose (7), base velocity (6) and joint angles set by hand, in MuJoCo's order."""
    task = env.task
    task.qpos[0], task.qvel[0, :6] = torch.tensor([*qpos, *angles]), torch.tensor(qvel)
    env.sim.forward(torch.tensor([0]))
    return env.current_state()


def state_of(**values: float | list[float]) -> dict[str, Tensor]:
    """What the rewards read: one world that follows its command exactly, without torques, except for `values`."""
    perfect = {"velocity_error": [0.0, 0.0], "yaw_rate_error": 0.0, "torques": [0.0] * 12}
    return {name: torch.tensor([value]) for name, value in (perfect | values).items()}


def touched(**forces: list[float]) -> dict[str, Tensor]:
    """Contact forces of one world in which only these bodies are touched."""
    force = torch.zeros(1, len(BODIES), 3)
    for body, value in forces.items():
        force[0, BODIES.index(body)] = torch.tensor(value)
    return {"contact_forces": force}


def test_the_original_variables_have_their_names_and_shapes():
    assert {name: Anymal.spec[name].shape for name in ORIGINAL} == ORIGINAL
    kinds = {Anymal.spec[f"{name}_scale"].kind for name in ("lin_vel", "ang_vel", "dof_pos", "dof_vel")}
    assert kinds == {"float"}


ORIGINAL = {
    "obs_buf": (48,),
    "root_states": (13,),
    "commands": (3,),
    "dof_pos": (12,),
    "dof_vel": (12,),
    "default_dof_pos": (12,),
    "gravity_vec": (3,),
    "actions": (12,),
    "torques": (12,),
    "contact_forces": (13, 3),
}


def test_masses_and_inertias_are_those_of_the_original():
    model = Anymal.compile_model()
    assert model.body_mass.sum() == pytest.approx(51.99, abs=0.005)
    masses = {"base": 26.23, "LF_HIP": 2.781, "RH_THIGH": 3.071, "LH_SHANK": 0.588}
    for body, mass in masses.items():
        assert model.body(body).mass[0] == pytest.approx(mass)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    base = data.body("base").ximat.reshape(3, 3) @ np.diag(model.body("base").inertia)
    base = base @ data.body("base").ximat.reshape(3, 3).T
    np.testing.assert_allclose(base, [[0.214, 0, 0.059], [0, 1.78, 0], [0.059, 0, 1.832]], atol=1e-6)
    # Legs are mirror images, so only the base pulls the centre of mass aside: 26.23 / 51.99 * -0.2 mm.
    data.qpos[7:] = DEFAULT_ANGLES
    mujoco.mj_forward(model, data)
    assert data.subtree_com[0][1] == pytest.approx(-0.0001, abs=1e-5)


def test_joints_come_leg_by_leg_with_their_ranges_and_drives():
    model = Anymal.compile_model()
    assert (model.nq, model.nv, model.nu) == (19, 18, 12)
    names = [f"{leg}_{joint}" for leg in ("LF", "LH", "RF", "RH") for joint in ("HAA", "HFE", "KFE")]
    assert [model.joint(i).name for i in range(1, 13)] == names
    assert [model.joint(int(j)).name for j in model.actuator_trnid[:, 0]] == names
    turn = [-9.42, 9.42]
    left, right = ([-0.72, 0.49], turn, turn), ([-0.49, 0.72], turn, turn)
    np.testing.assert_allclose(model.jnt_range[1:], [*left, *left, *right, *right])
    np.testing.assert_allclose(model.actuator_gainprm[:, 0], 85.0)
    np.testing.assert_allclose(model.actuator_biasprm[:, :3], [[0, -85.0, -2.0]] * 12)
    np.testing.assert_allclose(model.actuator_forcerange, [[-80.0, 80.0]] * 12)
    default = [0.03, 0.4, -0.8, 0.03, -0.4, 0.8, -0.03, 0.4, -0.8, -0.03, -0.4, 0.8]
    assert list(DEFAULT_ANGLES) == default


def test_feet_hang_where_the_leg_lengths_put_them():
    model = Anymal.compile_model()
    data = mujoco.MjData(model)
    data.qpos[:] = [0, 0, 0.62, 1, 0, 0, 0, *[0.0] * 12]
    mujoco.mj_forward(model, data)
    # Straight left front leg: 0.2999 + 0.0599 + 0.08795 ahead, 0.104 + 0.08381 + 0.1003 + 0.01305 to the left,
    # 0.285 + 0.31547 down.
    assert data.geom("LF_FOOT").xpos == pytest.approx([0.44775, 0.30116, 0.62 - 0.60047])
    assert data.geom("RH_FOOT").xpos == pytest.approx([-0.44775, -0.30116, 0.62 - 0.60047])
    data.qpos[7:] = DEFAULT_ANGLES
    mujoco.mj_forward(model, data)
    clearance = [data.geom(f"{leg}_FOOT").xpos[2] - 0.03 for leg in LEGS]
    assert clearance == pytest.approx([0.077] * 4, abs=5e-4)


def test_legs_pass_through_each_other_but_not_through_the_floor():
    model = Anymal.compile_model()
    floor = model.geom("floor").id
    collide = (model.geom_contype[:, None] & model.geom_conaffinity) != 0
    collide |= collide.T
    expected = np.zeros_like(collide)
    expected[floor] = expected[:, floor] = True
    expected[floor, floor] = collide[floor, floor]
    assert (collide == expected).all()


def test_it_stands_on_its_feet_when_nothing_is_asked():
    env = make(worlds=1)
    placed(env, [0, 0, 0.62, 1, 0, 0, 0], [0] * 6)
    assert not env.current_state()["contact_forces"].any()
    for _ in range(200):
        step = env.step(torch.zeros(1, 12))
        assert not step.terminated.any()
    # Unloaded, the legs would hold the base at 0.62 - 0.077 = 0.543 m; the drives give way by a few centimetres.
    assert 0.43 < float(step.state["base_height"]) < 0.53
    force = step.state["contact_forces"][0]
    shanks = [BODIES.index(f"{leg}_SHANK") for leg in LEGS]
    # 51.99 kg * 9.81 m/s^2 = 510 N, upwards
    assert float(force[shanks, 2].sum()) == pytest.approx(510.0, rel=0.02)
    assert float(force[shanks, 2].min()) > 100.0
    assert float(force.norm(dim=-1).sum()) == pytest.approx(float(force[shanks].norm(dim=-1).sum()))


def test_torques_are_those_of_the_drives_within_their_limit():
    env = make(worlds=1)
    placed(env, [0, 0, 2.0, 1, 0, 0, 0], [0] * 6)
    env.task.qvel[0, 6:] = 0.0
    env.task.ctrl[0] = env.task.default_dof_pos[0] + torch.tensor([0.1, 1.0] + [0.0] * 10)
    env.sim.forward(torch.tensor([0]))
    # 85 N m/rad * 0.1 rad; 85 N m are cut off at 80
    assert env.current_state()["torques"][0].tolist() == pytest.approx([8.5, 80.0] + [0.0] * 10, abs=1e-3)


def test_actions_are_offsets_of_the_joint_targets():
    env = make(worlds=1)
    env.step(torch.tensor([[1.0, -0.5, 3.0] + [0.0] * 9]))
    # default + 0.5 * action, the third clamped to 1
    assert env.task.ctrl[0, :4].tolist() == pytest.approx([0.53, 0.15, -0.3, 0.03])


def test_velocities_are_turned_into_the_frame_of_the_base():
    env = make()
    env.task.commands[0] = torch.tensor([2.0, 0.5, -1.0])
    # Facing the world's y (a quarter turn to the left), moving 3 m/s along y and 1 m/s along x: ahead and to the right.
    state = placed(env, [1, 2, 0.6, HALF, 0, 0, HALF], [1, 3, 0, 0.2, 0, 0.5])
    expected = [1, 2, 0.6, 0, 0, HALF, HALF, 1, 3, 0, 0, 0.2, 0.5]
    torch.testing.assert_close(state["root_states"][0], torch.tensor(expected), atol=1e-6, rtol=0)
    torch.testing.assert_close(state["base_linear_velocity"][0], torch.tensor([3.0, -1.0, 0.0]), atol=1e-6, rtol=0)
    torch.testing.assert_close(state["base_angular_velocity"][0], torch.tensor([0.2, 0.0, 0.5]))
    torch.testing.assert_close(state["velocity_error"][0], torch.tensor([-1.0, 1.5]), atol=1e-6, rtol=0)
    assert float(state["yaw_rate_error"][0]) == pytest.approx(-1.5)
    assert float(state["up_proj"][0]) == pytest.approx(1.0)
    assert not state["joint_offsets"][0].any()


def test_up_proj_is_the_cosine_of_the_tilt():
    sixty = math.radians(60) / 2
    state = placed(make(), [0, 0, 0.6, math.cos(sixty), math.sin(sixty), 0, 0], [0] * 6)
    assert float(state["up_proj"][0]) == pytest.approx(0.5)


def test_episodes_start_in_the_air_near_the_standing_pose_with_a_command_each():
    env = make(worlds=2000)
    state = env.current_state()
    assert torch.equal(state["root_states"][:, :7], torch.tensor([0, 0, 0.62, 0, 0, 0, 1.0]).repeat(2000, 1))
    assert not state["root_states"][:, 7:].any()
    ranges = {
        "share of the default angle": (state["dof_pos"] / torch.tensor(DEFAULT_ANGLES), 0.5, 1.5),
        "joint rate": (state["dof_vel"], -0.1, 0.1),
        "forward command": (state["commands"][:, 0], -2.0, 2.0),
        "left command": (state["commands"][:, 1], -1.0, 1.0),
        "yaw command": (state["commands"][:, 2], -1.0, 1.0),
    }
    for what, (values, low, high) in ranges.items():
        margin = 0.01 * (high - low)
        assert low - 1e-6 <= values.min() < low + margin, what
        assert high - margin < values.max() <= high + 1e-6, what


def test_commands_last_for_an_episode():
    env = make(worlds=4)
    first = env.current_state()["commands"]
    env.task.progress[:2] = 2498
    step = env.step(torch.zeros(4, 12))
    assert step.timed_out.tolist() == [True, True, False, False]
    assert torch.equal(step.state["commands"], first)
    second = env.current_state()["commands"]
    assert torch.equal(second[2:], first[2:]) and not (second[:2] == first[:2]).any()


def test_more_than_a_newton_on_base_or_thigh_ends_the_episode():
    task = make(1).task
    assert not task.terminated(touched(base=[0.0, 0.0, 0.9], RH_THIGH=[0.7, 0.0, 0.7]))
    assert task.terminated(touched(base=[0.0, 0.8, -0.8]))  # 1.13 N
    assert all(task.terminated(touched(**{f"{leg}_THIGH": [0.0, 0.0, 1.1]})) for leg in LEGS)
    others = {f"{leg}_{part}": [50.0, 0.0, 300.0] for leg in LEGS for part in ("HIP", "SHANK")}
    assert not task.terminated(touched(**others))


def test_a_robot_dropped_on_its_back_fails_on_impact_and_not_before():
    env = make()
    placed(env, [0, 0, 0.5, 0, 1, 0, 0], [0] * 6)
    # The lidar reaches 0.1335 + 0.06 + 0.07 = 0.2635 m up, so it falls 0.2365 m: sqrt(2 * 0.2365 / 9.81) = 0.22 s.
    steps = [env.step(torch.zeros(2, 12)) for _ in range(14)]
    failed = [bool(step.terminated[0]) for step in steps]
    assert failed.index(True) in (10, 11)
    assert not any(bool(step.terminated[1]) for step in steps)


def test_fitness_is_minus_the_squared_errors_on_every_step():
    # 0.5^2 + 1^2 + 2^2 = 5.25
    state = state_of(velocity_error=[0.5, -1.0], yaw_rate_error=2.0)
    task = make(1).task
    score = task.fitness(state, torch.tensor([False]))
    assert score.value.tolist() == [-5.25] and score.weight.tolist() == [1.0]
    assert task.score_unit == "sum of squared velocity errors, negated"
    assert task.sparse_reward(state).tolist() == [-5.25]


def test_standing_still_scores_minus_two():
    env = make(worlds=4000)
    still = env.current_state()
    # Variances of uniform commands: 4/3 + 1/3 + 1/3
    assert float(env.task.fitness(still, torch.zeros(4000)).value.mean()) == pytest.approx(-2.0, abs=0.06)


def test_human_reward_is_never_negative():
    helpless = state_of(velocity_error=[3.0, 0.0], yaw_rate_error=3.0, torques=[80.0] * 12)
    assert make(1).task.human_reward(helpless).tolist() == [0.0]


def test_a_model_reads_commands_and_errors_but_no_score_or_threshold():
    source = context("anymal").source
    assert '"velocity_error": commands[:, :2] - linear[:, :2]' in source
    for secret in ("CONTACT_LIMIT", "THIGHS", "sparse_reward", "Recipe", "MAX_COMMAND"):
        assert secret not in source
