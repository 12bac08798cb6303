"""Allegro and Shadow Hand: their models, and the goals, rewards and scores that they share."""

import math
from typing import Any

import mujoco
import numpy as np
import pytest
import torch
from torch import Tensor

from openeureka.suite.isaac.allegro_hand import AllegroHand
from openeureka.suite.isaac.reorientation import Reorientation, rotation_distance
from openeureka.suite.isaac.shadow_hand import ShadowHand
from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.noise import WorldNoise
from openeureka.tasks.rotations import conjugate, multiply, rotate

HANDS = pytest.mark.parametrize("hand", [AllegroHand, ShadowHand])
HALF = math.sqrt(0.5)


def make(hand: type[Reorientation], worlds: int = 2) -> BatchedEnv:
    env = BatchedEnv(hand, worlds=worlds, threads=1)
    env.reset()
    return env


def task_of(env: BatchedEnv) -> Reorientation:
    assert isinstance(env.task, Reorientation)
    return env.task


def hold(env: BatchedEnv) -> Tensor:
    """Actions that keep the joints about where they are at the start."""
    task = task_of(env)
    lower, upper = task.dof_lower_limits[task.driven], task.dof_upper_limits[task.driven]
    return (2.0 * task.qpos[:, : task.num_dofs][:, task.driven] - upper - lower) / (upper - lower)


def floating_at_its_goal(env: BatchedEnv, world: int) -> None:
    """Lift a world's cube clear of the hand, in its goal orientation."""
    task = task_of(env)
    cube = task.num_dofs
    task.qpos[world, cube + 2] += 0.1
    x, y, z, w = task.goal_rot[world]
    task.qpos[world, cube + 3 :] = torch.stack((w, x, y, z))
    env.sim.forward(torch.tensor([world]))


def reward_state(**values: float | list[float]) -> dict[str, Tensor]:
    """What rewards read: one world, the cube at its goal position, half a turn off, unless said otherwise."""
    rest = {
        "object_pos": [0.0, -0.2, 0.52],
        "goal_pos": [0.0, -0.2, 0.52],
        "rotation_distance": math.pi,
        "actions": [0.0] * 16,
    }
    return {name: torch.tensor([value]) for name, value in (rest | values).items()}


def test_allegro_has_the_specified_masses_joints_and_drives():
    model = AllegroHand.compile_model()
    hand = {"palm": 0.4154, "index_0": 0.0119, "index_1": 0.065, "index_2": 0.0355, "index_3": 0.0306}
    hand |= {"thumb_0": 0.0176, "thumb_1": 0.0119, "thumb_2": 0.038, "thumb_3": 0.0598}
    for body, mass in hand.items():
        assert model.body(body).mass[0] == pytest.approx(mass)
    # The cube is 0.065 m wide, of 400 kg/m3.
    assert model.body("object").mass[0] == pytest.approx(0.10985)
    assert model.body_mass.sum() == pytest.approx(0.05 + 0.4154 + 3 * 0.143 + 0.1273 + 0.10985)
    fingers = [f"{finger}_{i}" for finger in ("index", "middle", "ring", "thumb") for i in range(4)]
    assert [model.joint(i).name for i in range(16)] == fingers
    assert [model.joint(int(i)).name for i in model.actuator_trnid[:, 0]] == fingers
    assert model.joint("thumb_0").range == pytest.approx([0.279244, 1.570750])
    assert model.joint("ring_3").range == pytest.approx([-0.279244, 1.727825])
    assert model.actuator_gainprm[:, 0] == pytest.approx([3.0] * 16)
    assert model.actuator_biasprm[:, 2] == pytest.approx([-0.1] * 16)
    assert model.actuator_forcerange[:, 1] == pytest.approx([0.5] * 16)


def test_allegro_joints_move_no_faster_than_the_original_allows():
    env = make(AllegroHand, worlds=8)
    generator = torch.Generator().manual_seed(0)
    fastest = 0.0
    for _ in range(30):
        from_end_to_end = torch.randint(0, 2, (8, 16), generator=generator) * 2.0 - 1.0
        fastest = max(fastest, float(env.step(from_end_to_end).state["shadow_hand_dof_vel"].abs().max()))
    # The original clamps at 6.283 rad/s; a finger may be thrown a little faster by its neighbour's joint.
    assert 5.0 < fastest < 9.0


def test_allegro_stands_where_the_specification_puts_it():
    model = AllegroHand.compile_model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bases = {"index": (-0.045, -0.133, 0.497), "middle": (0, -0.135, 0.496), "ring": (0.045, -0.133, 0.497)}
    for finger, position in {**bases, "thumb": (-0.017, -0.043, 0.487)}.items():
        assert data.body(f"{finger}_0").xpos == pytest.approx(position, abs=6e-4)
    palm = data.body("palm").xmat.reshape(3, 3)
    assert palm[:, 2] == pytest.approx([0, -0.094, 0.996], abs=1e-3)
    # Fingers point along -y; the thumb's joint lies beside the palm.
    assert data.body("middle_3").xpos[1] < data.body("middle_2").xpos[1] < data.body("middle_1").xpos[1]


def test_shadow_hand_and_its_cube_have_the_specified_mass():
    model = ShadowHand.compile_model()
    # 0.05 m wide, 567 kg/m3
    assert model.body("object").mass[0] == pytest.approx(0.070875)
    assert model.body_mass.sum() == pytest.approx(5.011 + 0.070875)
    assert (model.nv, model.nu) == (24 + 6, 20)


@HANDS
def test_a_cube_lies_in_the_still_hand(hand: type[Reorientation]):
    env = make(hand, worlds=8)
    task = task_of(env)
    lower, upper = task.dof_lower_limits[task.driven], task.dof_upper_limits[task.driven]
    flat = ((-upper - lower) / (upper - lower)).clamp(-1, 1).repeat(8, 1)
    fallen = torch.zeros(8, dtype=torch.bool)
    for _ in range(round(3.0 / hand.control_dt)):
        fallen |= env.step(flat).terminated
    assert int(fallen.sum()) <= 1, "a start pose may throw the cube off"


@HANDS
def test_actions_are_joint_angles_between_the_limits(hand: type[Reorientation]):
    env = make(hand, worlds=3)
    task = task_of(env)
    task.apply_action(torch.tensor([-1.0, 0.0, 1.0])[:, None].repeat(1, hand.num_actions))
    lower, upper = task.sim.model.actuator_ctrlrange.T
    torch.testing.assert_close(
        task.ctrl.double(), torch.from_numpy(np.stack((lower, (lower + upper) / 2, upper))), atol=1e-6, rtol=0
    )


@HANDS
def test_an_episode_starts_with_bent_joints_and_the_cube_above_the_palm(hand: type[Reorientation]):
    env = make(hand, worlds=256)
    task, state = task_of(env), env.current_state()
    lower, upper = task.dof_lower_limits, task.dof_upper_limits
    angles = state["shadow_hand_dof_pos"]
    assert bool((angles >= torch.maximum(0.2 * lower, lower) - 1e-6).all())
    assert bool((angles <= torch.maximum(0.2 * upper, lower) + 1e-6).all())
    assert bool((angles.std(dim=0) > 0.02 * (0.2 * (upper - lower))).all())
    torch.testing.assert_close(task.ctrl, angles[:, task.driven])
    offset = state["object_pos"] - torch.tensor(hand.object_start)
    assert float(offset.abs().max()) <= 0.01 + 1e-6 and float(offset.std()) > 0.005
    assert not state["shadow_hand_dof_vel"].any() and not state["object_linvel"].any()
    assert state["goal_pos"].unique(dim=0).tolist() == [pytest.approx(hand.goal_position)]
    assert not torch.equal(state["object_rot"], state["goal_rot"])


def test_random_rotations_turn_about_y_and_then_about_x(monkeypatch: pytest.MonkeyPatch):
    task = task_of(make(AllegroHand))
    monkeypatch.setattr(WorldNoise, "uniform", lambda *_: torch.tensor([[0.5, 0.5], [1.0, 0.0]]))
    quarter_each, half_about_x = task.random_rotation(torch.arange(2))
    # A quarter turn about y takes x to -z and z to x. Then one about x takes -z to y and leaves x.
    x, z = torch.tensor([1.0, 0.0, 0.0]), torch.tensor([0.0, 0.0, 1.0])
    torch.testing.assert_close(rotate(quarter_each, x), torch.tensor([0.0, 1.0, 0.0]), atol=1e-6, rtol=0)
    torch.testing.assert_close(rotate(quarter_each, z), x, atol=1e-6, rtol=0)
    torch.testing.assert_close(rotate(half_about_x, z), -z, atol=1e-6, rtol=0)


def test_products_of_quaternions_turn_by_the_second_and_then_by_the_first():
    about_x, about_z = torch.tensor([HALF, 0, 0, HALF]), torch.tensor([0, 0, HALF, HALF])
    vector = torch.tensor([1.0, 2.0, 3.0])
    # About z: (-2, 1, 3); then about x: (-2, -3, 1).
    torch.testing.assert_close(rotate(multiply(about_x, about_z), vector), torch.tensor([-2.0, -3.0, 1.0]))
    torch.testing.assert_close(rotate(conjugate(about_x), vector), torch.tensor([1.0, 3.0, -2.0]))


def test_rotation_distance_is_the_angle_between_orientations():
    start = torch.tensor([0.5, 0.5, 0.5, 0.5])
    for angle in (0.0, 0.1, math.pi / 2, math.pi):
        turn = torch.tensor([0.0, math.sin(angle / 2), 0.0, math.cos(angle / 2)])
        for goal in (multiply(turn, start), -multiply(turn, start)):
            assert rotation_distance(goal, start).item() == pytest.approx(angle, abs=1e-3)


@HANDS
def test_a_reached_goal_is_paid_and_replaced_and_the_episode_goes_on(hand: type[Reorientation]):
    env = make(hand)
    task = task_of(env)
    floating_at_its_goal(env, world=0)
    actions = hold(env)

    step = env.step(actions)
    before = step.state["goal_rot"]
    assert step.state["rotation_distance"][0] < 0.1 < step.state["rotation_distance"][1]
    assert task.success_bonus(step.state).tolist() == [250.0, 0.0]
    assert task.sparse_reward(step.state).tolist() == [1.0, 0.0]
    assert step.score.value.tolist() == [1.0, 0.0] and not step.done.any()

    step = env.step(actions)
    after = step.state["goal_rot"]
    assert not torch.equal(after[0], before[0]) and torch.equal(after[1], before[1])
    torch.testing.assert_close(step.state["rotation_distance"], rotation_distance(step.state["object_rot"], after))
    assert step.score.value.tolist() == [1.0, 0.0], "a goal counts once"
    model, data = env.sim.snapshot(0)
    x, y, z, w = after[0].tolist()
    assert data.body("goal").xquat == pytest.approx([w, x, y, z], abs=1e-6), "videos show the goal"
    assert model.body("goal").mocapid[0] == 0


@HANDS
def test_fitness_is_the_number_of_goals_of_the_episodes_that_end(hand: type[Reorientation]):
    env = make(hand)
    task = task_of(env)
    task.goals_reached[:] = torch.tensor([3.0, 5.0])
    floating_at_its_goal(env, world=0)
    task.progress[:] = torch.tensor([hand.episode_length - 2, 7])
    step = env.step(hold(env))
    # The first world's time is up on the step that reaches its fourth goal.
    assert step.timed_out.tolist() == [True, False]
    assert step.score.value.tolist() == [4.0, 5.0] and step.score.weight.tolist() == [1.0, 0.0]
    assert task.goals_reached.tolist() == [0.0, 5.0]


@HANDS
def test_an_episode_fails_when_the_cube_is_24_cm_from_its_place(hand: type[Reorientation]):
    task = task_of(make(hand))
    near = {"object_pos": torch.tensor([[0.0, 0.0, 0.239], [0.0, 0.144, 0.193]]), "goal_pos": torch.zeros(2, 3)}
    # 0.144^2 + 0.193^2 = 0.2408^2
    assert task.terminated(near).tolist() == [False, True]


def test_the_human_reward_by_hand():
    task = task_of(make(AllegroHand))
    # 10 cm off: -1; half a turn off: 1 / (pi + 0.1); 16 actions of 0.5: -0.0002 * 4.
    off = reward_state(object_pos=[0.0, -0.2, 0.62], actions=[0.5] * 16)
    assert task.human_reward(off).item() == pytest.approx(-1.0 + 1 / (math.pi + 0.1) - 0.0008, abs=1e-5)
    # 1 / (0.1 + 0.1) = 5 on the goal, and 250 for it.
    assert task.human_reward(reward_state(rotation_distance=0.1)).item() == pytest.approx(255.0, abs=1e-3)


def observation_parts(hand: type[Reorientation], names: list[tuple[str, int, float]]) -> None:
    """Check an observation against (variable or literal part, size, factor) in order."""
    env = make(hand)
    generator = torch.Generator().manual_seed(0)
    state: dict[str, Any] = env.current_state()
    for name, value in state.items():
        if isinstance(value, Tensor) and value.shape[:1] == (2,):
            state[name] = torch.randn(value.shape, generator=generator)
    observation = env.task.observe(state)
    start = 0
    for name, size, factor in names:
        part, start = observation[:, start : start + size], start + size
        if name in state:
            torch.testing.assert_close(part, factor * state[name].flatten(1), msg=name)
    assert start == observation.shape[1]


def test_allegro_observes_88_numbers():
    cube = [("object_pose", 7, 1.0), ("object_linvel", 3, 1.0), ("object_angvel", 3, 0.2), ("goal_pose", 7, 1.0)]
    joints = [("angles", 16, 1.0), ("shadow_hand_dof_vel", 16, 0.2), ("dof_force_tensor", 16, 10.0)]
    observation_parts(AllegroHand, [*joints, *cube, ("relative rotation", 4, 1.0), ("actions", 16, 1.0)])


def test_shadow_observes_211_numbers():
    cube = [("object_pose", 7, 1.0), ("object_linvel", 3, 1.0), ("object_angvel", 3, 0.2), ("goal_pose", 7, 1.0)]
    joints = [("angles", 24, 1.0), ("shadow_hand_dof_vel", 24, 0.2), ("dof_force_tensor", 24, 10.0)]
    tips = [("fingertip_state", 65, 1.0), ("vec_sensor_tensor", 30, 10.0)]
    observation_parts(ShadowHand, [*joints, *cube, ("relative rotation", 4, 1.0), *tips, ("actions", 20, 1.0)])


@HANDS
def test_raw_tensors_hold_hand_cube_and_goal(hand: type[Reorientation]):
    state = make(hand).current_state()
    roots = state["root_state_tensor"]
    assert roots[0, 0, :3].tolist() == pytest.approx([0.0, 0.0, 0.5])
    cube = torch.cat((state["object_pose"], state["object_linvel"], state["object_angvel"]), dim=-1)
    torch.testing.assert_close(roots[:, state["object_indices"]], cube)
    torch.testing.assert_close(roots[:, 2], state["goal_states"])
    torch.testing.assert_close(state["goal_states"][:, :7], torch.cat((state["goal_pos"], state["goal_rot"]), dim=-1))


def test_fingertips_move_as_their_positions_change():
    env = make(ShadowHand)
    env.step(hold(env))
    task = task_of(env)
    task.qvel[:] = torch.randn(task.qvel.shape, generator=torch.Generator().manual_seed(0))
    both = torch.arange(2)
    env.sim.forward(both)
    first = env.current_state()
    tiny = 1e-3  # [s]
    task.qpos[:, :24] += tiny * task.qvel[:, :24]
    env.sim.forward(both)
    second = env.current_state()
    moved = (second["fingertip_pos"] - first["fingertip_pos"]) / tiny
    torch.testing.assert_close(first["fingertip_state"][..., 7:10], moved, atol=5e-3, rtol=0)
    turned = multiply(second["fingertip_state"][..., 3:7], conjugate(first["fingertip_state"][..., 3:7]))
    spin = 2.0 * turned[..., :3] * turned[..., 3:].sign() / tiny
    torch.testing.assert_close(first["fingertip_state"][..., 10:], spin, atol=2e-2, rtol=0)
    # The mount is at rest, and the rows that the handles name are the last links.
    assert not first["rigid_body_states"][:, 0, 7:].any()
    torch.testing.assert_close(first["rigid_body_states"][:, first["fingertip_handles"]], first["fingertip_state"])
    torch.testing.assert_close(first["rigid_body_states"][:, 26, :7], first["object_pose"])
    picture = first["rigid_body_states"][:, 27]
    torch.testing.assert_close(picture[:, 3:7], first["goal_rot"])
    assert float((picture[:, :3] - first["goal_pos"]).norm(dim=-1).min()) > 0.2
    assert "a picture of the goal, beside goal_pos" in task.spec["rigid_body_states"].meaning
