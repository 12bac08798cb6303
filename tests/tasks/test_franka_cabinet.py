import math

import mujoco
import numpy as np
import pytest
import torch

from openeureka.suite.isaac.franka_cabinet import DEFAULT_POSE, FrankaCabinet
from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.registry import make


@pytest.fixture
def env() -> BatchedEnv:
    simulation = make("franka_cabinet", worlds=3, threads=1)
    simulation.reset()
    return simulation


def place(env: BatchedEnv, *, arm=DEFAULT_POSE, cabinet=(0.0, 0.0, 0.0, 0.0), speed: float = 0.0) -> dict:
    """State of all worlds in this pose, with every joint moving at `speed` and the drives' targets at the pose."""
    env.task.qpos[:] = torch.tensor((*arm, *cabinet))
    env.task.qvel[:] = speed
    env.task.franka_dof_targets[:] = torch.tensor(arm)
    env.sim.forward(torch.arange(env.num_worlds))
    return env.current_state()


def test_the_original_variables_have_their_names_and_shapes():
    variables = {variable.name: variable for variable in FrankaCabinet.spec.variables}
    shapes = {
        "obs_buf": (23,),
        "franka_grasp_pos": (3,),
        "franka_grasp_rot": (4,),
        "drawer_grasp_pos": (3,),
        "drawer_grasp_rot": (4,),
        "franka_lfinger_pos": (3,),
        "franka_rfinger_pos": (3,),
        "franka_lfinger_rot": (4,),
        "franka_rfinger_rot": (4,),
        "franka_dof_pos": (9,),
        "franka_dof_vel": (9,),
        "franka_dof_lower_limits": (9,),
        "franka_dof_upper_limits": (9,),
        "cabinet_dof_pos": (4,),
        "cabinet_dof_vel": (4,),
        "franka_local_grasp_pos": (3,),
        "franka_local_grasp_rot": (4,),
        "drawer_local_grasp_pos": (3,),
        "drawer_local_grasp_rot": (4,),
        "rigid_body_states": (31, 13),
    }
    assert {name: variables[name].shape for name in shapes} == shapes
    integers = ("hand_handle", "lfinger_handle", "rfinger_handle", "drawer_handle")
    assert [variables[name].kind for name in (*integers, "dof_vel_scale")] == ["int"] * 4 + ["float"]


def test_the_model_has_the_specified_masses_joints_and_drives():
    model = FrankaCabinet.compile_model()
    assert (model.nq, model.nv, model.nu) == (13, 13, 9)
    mass = {model.body(i).name: model.body_mass[i] for i in range(model.nbody)}
    links = [mass[f"panda_link{i}"] for i in range(1, 8)]
    assert links == pytest.approx([2.98, 3.00, 2.33, 2.37, 3.42, 1.44, 1.16], abs=0.01)
    assert mass["panda_leftfinger"] == mass["panda_rightfinger"] == pytest.approx(0.022)
    assert sum(links) + 0.044 == pytest.approx(16.7, abs=0.05)
    assert [mass[name] for name in ("door_left", "door_right", "drawer_bottom", "drawer_top")] == pytest.approx(
        [3.9, 3.9, 43.0, 5.3]
    )
    # 16 cubes of 0.08^3 m^3 * 400 kg/m^3 = 0.2048 kg
    assert [mass[f"prop{i}"] for i in range(16)] == pytest.approx([0.2048] * 16)

    names = [model.joint(i).name for i in range(model.njnt)]
    fingers = ["panda_finger_joint1", "panda_finger_joint2"]
    assert names[:9] == [*(f"panda_joint{i}" for i in range(1, 8)), *fingers]
    assert names[9:] == ["door_left", "door_right", "drawer_bottom", "drawer_top"]
    assert model.jnt_range[[3, 5, 7, 12]].ravel() == pytest.approx([-3.0718, -0.0698, -0.0175, 3.7525, 0, 0.04, 0, 0.4])
    assert model.actuator_forcerange[:, 1].tolist() == [87.0] * 4 + [12.0] * 3 + [200.0] * 2
    assert [model.actuator(i).name for i in range(9)] == names[:9]


def test_hand_and_handle_are_where_the_specification_puts_them(env: BatchedEnv):
    state = place(env)
    assert state["franka_grasp_pos"][0].tolist() == pytest.approx([0.784, 0.082, 0.820], abs=1e-3)
    assert state["drawer_grasp_pos"][0].tolist() == pytest.approx([0.3515, 0.01, 0.7172], abs=1e-4)
    model, data = env.sim.snapshot(0)
    handle = next(i for i in range(model.ngeom) if np.allclose(2 * model.geom_size[i], [0.039, 0.167, 0.024]))
    corners = [data.geom_xpos[handle] + sign * model.geom_size[handle] for sign in (-1, 1)]
    assert [corner[[0, 2]].tolist() for corner in corners] == [
        pytest.approx([0.3245, 0.7142]),
        pytest.approx([0.3635, 0.7382]),
    ]


def test_the_hand_frame_by_hand(env: BatchedEnv):
    # The arm is stretched upwards with the hand pointing down, 0.088 m in front of the base axis, which is at x = 1.
    # Its height is 0.333 + 0.316 + 0.384 - 0.1654. The last link's y axis is the world's.
    state = place(env, arm=(0.0,) * 9)
    assert state["franka_grasp_pos"][0].tolist() == pytest.approx([0.912, 0.04, 0.8676], abs=1e-4)
    assert float(state["gripper_forward_proj"][0]) == pytest.approx(0.0, abs=1e-6)

    # With the wrist bent by 90 degrees the hand points at the cabinet, 0.088 m above the elbow. The last joint's -45
    # degrees and the hand's own -45 put the left finger on top. 0.04 m along the last link's y go half left, half up.
    state = place(env, arm=(0, 0, 0, 0, 0, math.pi / 2, -math.pi / 4, 0.03, 0.01))
    half = 0.04 * math.sqrt(0.5)
    assert state["franka_grasp_pos"][0].tolist() == pytest.approx([1 - 0.1654, half, 1.033 + 0.088 + half], abs=1e-4)
    assert float(state["gripper_forward_proj"][0]) == pytest.approx(1.0)
    assert float(state["gripper_up_proj"][0]) == pytest.approx(1.0)
    assert float(state["left_finger_above_handle"][0]) == pytest.approx(1.121 + 0.03 - 0.7172, abs=1e-4)
    assert float(state["right_finger_below_handle"][0]) == pytest.approx(0.7172 - (1.121 - 0.01), abs=1e-4)
    assert float(state["finger_gap"][0]) == pytest.approx(0.04)


def test_a_drawer_that_is_pulled_out_carries_its_grasp_point(env: BatchedEnv):
    state = place(env, cabinet=(-0.5, 0.5, 0.1, 0.25), speed=0.3)
    assert state["drawer_grasp_pos"][0].tolist() == pytest.approx([0.6015, 0.01, 0.7172], abs=1e-4)
    assert float(state["drawer_opening"][0]) == 0.25 and float(state["drawer_speed"][0]) == pytest.approx(0.3)
    assert torch.equal(state["cabinet_dof_pos"][0], torch.tensor([-0.5, 0.5, 0.1, 0.25]))


def test_rigid_body_states_are_those_of_mujoco(env: BatchedEnv):
    bodies = place(env, cabinet=(-0.5, 0.5, 0.1, 0.2), speed=0.4)["rigid_body_states"][0]
    model, data = env.sim.snapshot(0)
    velocity = np.zeros(6)
    for row, name in (
        (env.task.hand_handle, "panda_link7"),
        (env.task.lfinger_handle, "panda_leftfinger"),
        (11, "door_left"),
    ):
        body = model.body(name).id
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocity, 0)
        assert bodies[row, :3].tolist() == pytest.approx(data.xpos[body].tolist(), abs=1e-5)
        assert bodies[row, [6, 3, 4, 5]].tolist() == pytest.approx(data.xquat[body].tolist(), abs=1e-5)
        assert bodies[row, 7:].tolist() == pytest.approx([*velocity[3:], *velocity[:3]], abs=1e-5)
    assert bodies[env.task.drawer_handle, 7:].tolist() == pytest.approx([0.4, 0, 0, 0, 0, 0], abs=1e-6)


def test_episodes_start_near_the_default_pose_before_a_closed_cabinet():
    env = make("franka_cabinet", worlds=500, threads=1)
    env.reset()
    offset = env.task.qpos[:, :7] - torch.tensor(DEFAULT_POSE[:7])
    assert torch.allclose(offset.min(0).values, torch.tensor(-0.125), atol=5e-3)
    assert torch.allclose(offset.max(0).values, torch.tensor(0.125), atol=5e-3)
    # 0.035 +- 0.125 m, cut to 0 .. 0.04: closed in 9/25 = 0.36 of the worlds, wide open in 12/25 = 0.48
    fingers = env.task.qpos[:, 7:9]
    assert float((fingers == 0.0).float().mean()) == pytest.approx(0.36, abs=0.06)
    assert float((fingers == 0.04).float().mean()) == pytest.approx(0.48, abs=0.06)
    assert not env.task.qpos[:, 9:].any() and not env.task.qvel.any()
    assert torch.equal(env.task.franka_dof_targets, env.task.qpos[:, :9])


def test_actions_move_the_targets_by_their_speed_within_the_limits(env: BatchedEnv):
    place(env)
    env.step(torch.tensor([1.0, -0.5, 0, 0, 0, 0, 0, -1.0, 0.2]).repeat(3, 1))
    # 7.5 rad/s / 60 = 0.125 rad, a tenth of it for fingers
    moved = env.task.franka_dof_targets[0] - torch.tensor(DEFAULT_POSE)
    assert moved.tolist() == pytest.approx([0.125, -0.0625, 0, 0, 0, 0, 0, -0.0125, 0.0025], abs=1e-6)
    for _ in range(40):
        env.step(torch.ones(3, 9))
    limits = env.sim.model.jnt_range[:9, 1]
    assert env.task.franka_dof_targets[0].tolist() == pytest.approx(limits.tolist(), abs=1e-5)


def test_no_joint_runs_faster_than_the_original_lets_it(env: BatchedEnv):
    place(env)
    limits = torch.tensor([2.175] * 4 + [2.61] * 3 + [0.2] * 2)
    fastest = torch.zeros(9)
    for step in range(120):
        rates = env.step(torch.full((3, 9), 1.0 if step % 60 < 30 else -1.0)).state["franka_dof_vel"][0]
        fastest = torch.maximum(fastest, rates.abs())
    assert torch.all(fastest < 1.2 * limits)
    assert torch.all(fastest > 0.7 * limits)


def test_the_arm_keeps_its_pose_without_gravity(env: BatchedEnv):
    place(env)
    for _ in range(60):
        state = env.step(torch.zeros(3, 9)).state
    assert state["franka_dof_pos"][0].tolist() == pytest.approx(DEFAULT_POSE, abs=1e-5)


def test_a_pulled_drawer_moves_as_its_mass_and_damping_say():
    model = FrankaCabinet.compile_model()
    data = mujoco.MjData(model)
    data.qpos[:9] = data.ctrl[:] = DEFAULT_POSE
    data.qfrc_applied[12] = 10.0
    steps = round(0.3 / model.opt.timestep)
    mujoco.mj_step(model, data, steps)
    # (10 - 0.01) N / 10 N s/m, approached with 8.582 kg / 10 N s/m: drawer 5.3, cubes 3.277, armature 0.005
    expected = 0.999 * (1 - math.exp(-data.time / 0.8582))
    assert data.qvel[12] == pytest.approx(expected, rel=0.01)
    assert abs(data.qvel[9:12]).max() < 1e-6


def test_a_closed_grip_on_the_handle_opens_the_drawer():
    """Reach for the handle with open fingers, close them, pull, by inverse kinematics in the task's own actions."""
    env = make("franka_cabinet", worlds=1, threads=1)
    env.reset()
    place(env)
    handle = np.array([0.352, 0.0, 0.7262])
    away = np.array([1.0, 0.0, 0.0])
    reach = [(handle + 0.2 * away, 1.0)] * 80 + [(handle, 1.0)] * 60 + [(handle, -1.0)] * 30
    pull = [(handle + 0.002 * i * away, -1.0) for i in range(320)]
    for goal, fingers in reach + pull:
        action = [*towards(env, goal) / 0.125, fingers, fingers]
        step = env.step(torch.tensor([action], dtype=torch.float32))
        if bool(step.done):
            break
    assert bool(step.terminated) and float(step.state["drawer_opening"]) > 0.39
    assert float(step.state["finger_gap"]) == pytest.approx(0.024, abs=0.004), "the fingers hold the handle"


def towards(env: BatchedEnv, goal: np.ndarray) -> np.ndarray:
    """Change of the arm's targets (7,) that brings the point between the fingertips to `goal`, left finger on top."""
    model, data = env.sim.model, mujoco.MjData(env.sim.model)
    data.qpos[:] = env.task.qpos[0]
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    hand = model.body("panda_link7").id
    axes = data.body("panda_leftfinger").xmat.reshape(3, 3)
    tip = data.xpos[hand] + 0.2054 * axes[:, 2]
    turn = np.cross(axes[:, 2], [-1, 0, 0]) + np.cross(axes[:, 1], [0, 0, 1])
    error = np.concatenate((goal - tip, 0.1 * turn)).clip(-0.1, 0.1)
    jacobian = np.zeros((6, model.nv))
    mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], tip, hand)
    jacobian[3:] *= 0.1
    arm = jacobian[:, :7]
    change = arm.T @ np.linalg.solve(arm @ arm.T + 1e-4 * np.eye(6), error)
    return change - (env.task.franka_dof_targets[0, :7].numpy() - data.qpos[:7])


def test_the_observation_is_laid_out_as_specified(env: BatchedEnv):
    state = place(env, cabinet=(0, 0, 0, 0.2), speed=0.5)
    observation = state["obs_buf"][0]
    # joint 4: (2 * -2.239 + 3.0718 + 0.0698) / (3.0718 - 0.0698); finger: 2 * 0.035 / 0.04 - 1
    assert observation[[3, 7]].tolist() == pytest.approx([-1.3364 / 3.002, 0.75], abs=1e-4)
    assert observation[9:18].tolist() == pytest.approx([0.05] * 9)
    assert observation[18:21].tolist() == pytest.approx([0.5515 - 0.7844, 0.01 - 0.0823, 0.7172 - 0.8199], abs=1e-3)
    assert observation[21:].tolist() == pytest.approx([0.2, 0.5])


def test_an_episode_succeeds_when_the_drawer_is_open(env: BatchedEnv):
    state = {"drawer_opening": torch.tensor([0.0, 0.389, 0.391])}
    assert env.task.terminated(state).tolist() == [False, False, True]
    assert env.task.sparse_reward(state).tolist() == [0.0, 0.0, 1.0]


def test_fitness_is_the_share_of_episodes_that_open_the_drawer(env: BatchedEnv):
    # World 0 opens it in step 2 of each episode, world 1 never, world 2 in step 2 of episodes that are not whole.
    value = weight = torch.zeros(3)
    for step in range(1, 500):
        first = step % 2
        env.task.progress[:] = torch.tensor([2 - first, step, 2 - first])
        state = {"drawer_opening": torch.tensor([0.4 * (1 - first), 0.0, 0.4 * (1 - first)])}
        score = env.task.fitness(state, torch.tensor([first == 0, step == 499, False]))
        value, weight = value + score.value * score.weight, weight + score.weight
        if step == 2:
            # Not 1, although every finished episode succeeded: 499 / (499 + 2 + 2)
            assert float(value.sum() / weight.sum()) == pytest.approx(499 / 503)
    # World 0: 249 episodes and a step. World 1: one episode of 499 steps. World 2: no whole episode in 499 steps.
    assert value.tolist() == pytest.approx([249 * 499, 0.0, 0.0])
    assert weight.tolist() == [249 * 499 + 1, 499.0, 499.0]


def test_an_episode_that_began_in_its_middle_does_not_count():
    env = BatchedEnv(FrankaCabinet, worlds=3)
    env.reset(stagger=True)
    env.sim.bind("qpos")[1:, 12] = 0.395
    env.sim.forward(torch.arange(3))
    env.task.progress[:], env._whole[:] = torch.tensor([3, 3, 3]), torch.tensor([False, False, True])
    score = env.step(torch.zeros(3, 9)).score
    assert score.weight.tolist() == [0.0, 0.0, 496.0]
    assert float(score.value[2]) == pytest.approx(499 / 496)


def test_human_reward_by_hand(env: BatchedEnv):
    # World 0: 1 m from the handle, sideways (-0.5, 0): 2 / 4 - 0.5 * 0.5 * 0.25 = 0.4375; actions -0.01 * 9.
    # World 1: 0.01 m away, aligned, fingers 0.03 above and 0.02 below, drawer at 0.25: 2 * 2 / 1.0001^2 + 0.5 +
    #   0.25 * 0.5 + 7.5 * (0.125 + 0.25) + 5 * (0.01 + 0.02) + 0.5 + 0.5
    # World 2: the same, but a finger is 5 cm behind the handle.
    drawer = torch.tensor([[0.35, 0.0, 0.7]]).repeat(3, 1)
    hand = drawer + torch.tensor([[1.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.01, 0.0, 0.0]])
    state = {
        "drawer_grasp_pos": drawer,
        "franka_grasp_pos": hand,
        "franka_lfinger_pos": hand,
        "franka_rfinger_pos": drawer - torch.tensor([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.05, 0.0, 0.0]]),
        "left_finger_above_handle": torch.tensor([-0.01, 0.03, 0.03]),
        "right_finger_below_handle": torch.tensor([0.02, 0.02, 0.02]),
        "gripper_forward_proj": torch.tensor([-0.5, 1.0, 1.0]),
        "gripper_up_proj": torch.tensor([0.0, 1.0, 1.0]),
        "drawer_opening": torch.tensor([0.0, 0.25, 0.25]),
        "actions": torch.tensor([[1.0], [0.0], [0.0]]).repeat(1, 9),
    }
    grasped = 4 / 1.0001**2 + 0.5 + 0.125 + 2.8125 + 0.15 + 1.0
    assert env.task.human_reward(state).tolist() == pytest.approx([0.4375 - 0.09, grasped, -1.0])
