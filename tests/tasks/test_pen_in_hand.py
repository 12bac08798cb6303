"""ShadowHandSpin and ShadowHandUpsideDown: the pen, its start, its goals, its score."""

import math
import re

import mujoco
import pytest
import torch
from torch import Tensor

from openeureka.suite.dexterity.pen_in_hand import PenInHand, ShadowHandSpin, ShadowHandUpsideDown
from openeureka.tasks import human, registry
from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.registry import get
from openeureka.tasks.rotations import multiply, rotate, rotation_distance, turn_about

PENS = pytest.mark.parametrize("task", [ShadowHandSpin, ShadowHandUpsideDown])
LONG_AXIS = torch.tensor([0.0, 0.0, 1.0])


def make(task: type, worlds: int = 2) -> BatchedEnv:
    env = BatchedEnv(task, worlds=worlds, threads=1)
    env.reset()
    return env


def task_of(env: BatchedEnv) -> PenInHand:
    assert isinstance(env.task, PenInHand)
    return env.task


def away_from_its_goal(env: BatchedEnv, angles: list[float]) -> Tensor:
    """Lift the pens clear of the hand, each turned off its goal by an angle [rad] about the vertical."""
    task = task_of(env)
    task.qpos[:, 26] += 0.1
    x, y, z, w = multiply(turn_about(2, torch.tensor(angles)), task.goal_rot).unbind(-1)
    task.qpos[:, 27:] = torch.stack((w, x, y, z), dim=-1)
    env.sim.forward(torch.arange(len(angles)))
    return torch.zeros(len(angles), task.num_actions)


@PENS
def test_the_pen_is_a_rod_of_42_grams(task: type[PenInHand]):
    model = task.compile_model()
    # 1000 kg/m3: pi 0.008^2 (0.2 + 4/3 * 0.008) m3
    assert model.body("object").mass[0] == pytest.approx(0.0424, abs=5e-5)
    assert (model.nv, model.nu) == (24 + 6, 20)


@pytest.mark.parametrize(("task", "up"), [(ShadowHandSpin, 1.0), (ShadowHandUpsideDown, -1.0)])
def test_fingers_point_along_minus_y_from_a_palm_that_faces_up_or_down(task: type[PenInHand], up: float):
    model = task.compile_model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    palm = data.body("hand_palm").xmat.reshape(3, 3)
    assert -palm[:, 1] == pytest.approx([0, 0, up], abs=1e-3)
    assert palm[:, 2] == pytest.approx([0, -1, 0], abs=1e-3)


@PENS
def test_the_model_is_told_how_far_below_the_palm_the_pen_should_stay(task: type[PenInHand]):
    model = task.compile_model()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    palm = model.body("hand_palm").id
    box = next(geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == palm and model.geom_contype[geom])
    up = 1.0 if task is ShadowHandSpin else -1.0
    surface = data.geom_xpos[box, 2] + up * model.geom_size[box, 1]  # the box is thinnest along its second axis
    (told,) = re.findall(r"(\d+) cm below .* palm", task.spec["goal_pos"].meaning)
    assert surface - task.goal_position[2] == pytest.approx(float(told) / 100, abs=0.005)


@PENS
def test_an_episode_starts_with_the_pen_along_the_forearm_and_free(task: type[PenInHand]):
    env = make(task, worlds=128)
    state = env.current_state()
    x, y, z = rotate(state["object_rot"], LONG_AXIS).unbind(-1)
    tilt = torch.atan2(-z, -y)  # a quarter turn about x takes z to -y, and turning on takes -y to -z
    assert float(x.abs().max()) < 1e-6
    assert 0.2 < float(tilt.max()) <= 0.3 + 1e-6 and -0.3 - 1e-6 <= float(tilt.min()) < -0.2
    offset = state["object_pos"] - torch.tensor(task.object_start)
    assert float(offset.abs().max()) <= 0.01 + 1e-6
    for world in range(128):
        model, data = env.sim.snapshot(world)
        touching = [contact for contact in data.contact if model.geom("object").id in contact.geom]
        assert not touching, "the pen starts inside the hand"


def test_a_pen_on_the_still_open_hand_stays_there():
    env = make(ShadowHandSpin, worlds=16)
    task = task_of(env)
    lower, upper = task.dof_lower_limits[task.driven], task.dof_upper_limits[task.driven]
    flat = ((-upper - lower) / (upper - lower)).clamp(-1, 1).repeat(16, 1)
    fallen = torch.zeros(16, dtype=torch.bool)
    for _ in range(90):  # 1.5 s
        fallen |= env.step(flat).terminated
    assert int(fallen.sum()) <= 2


def test_waypoints_are_twelve_turns_of_30_degrees_about_the_pens_own_y_axis():
    task = task_of(make(ShadowHandSpin))
    goal = task.first_waypoint
    # (-0.8, 0, 0, 1) of unit length is a turn about x by -2 atan 0.8 = -77.3 degrees: z goes to (0, sin, cos) of 77.3.
    torch.testing.assert_close(rotate(goal, LONG_AXIS), torch.tensor([0.0, 0.9756, 0.2195]), atol=1e-4, rtol=0)
    task.goal_rot[:] = goal
    axis = rotate(goal, torch.tensor([0.0, 1.0, 0.0]))
    for _ in range(12):
        following = task.next_goal()
        assert rotation_distance(following, task.goal_rot)[0].item() == pytest.approx(math.pi / 6, abs=1e-3)
        torch.testing.assert_close(rotate(following[0], torch.tensor([0.0, 1.0, 0.0])), axis, atol=1e-5, rtol=0)
        task.goal_rot[:] = following
    assert rotation_distance(task.goal_rot, goal)[0].item() == pytest.approx(0.0, abs=1e-3)


def test_an_episode_begins_with_any_waypoint():
    task = task_of(make(ShadowHandSpin, worlds=256))
    waypoints = torch.stack(
        [multiply(task.first_waypoint, turn_about(1, torch.tensor(k * math.pi / 6))) for k in range(12)]
    )
    distance = rotation_distance(task.goal_rot[:, None], waypoints)
    assert float(distance.min(dim=1).values.max()) < 2e-3
    # 256 draws: about 21 of each
    assert int(distance.argmin(dim=1).bincount(minlength=12).min()) >= 8


def test_a_reached_waypoint_counts_once_and_is_replaced_by_the_next():
    env = make(ShadowHandSpin)
    task = task_of(env)
    # The published test, 0.2 rad with a goal of length 1.2806, is 2 asin(sin(0.1) / 1.2806) = 0.156 rad.
    actions = away_from_its_goal(env, [0.13, 0.18])
    before = task.goal_rot.clone()
    following = task.next_goal()

    step = env.step(actions)
    assert step.score.value.tolist() == [1.0, 0.0]
    assert task.sparse_reward(step.state).tolist() == [1.0, 0.0]
    assert task.success_bonus(step.state).tolist() == [250.0, 0.0]
    assert not step.done.any()

    step = env.step(actions)
    torch.testing.assert_close(step.state["goal_rot"], torch.stack((following[0], before[1])))
    assert step.score.value.tolist() == [1.0, 0.0]


def test_random_goals_are_drawn_anew_and_reached_within_a_fifth_of_a_radian():
    env = make(get("shadow_hand_spin+random_goals=true"), worlds=2)
    task = task_of(env)
    actions = away_from_its_goal(env, [0.18, 0.22])
    before = task.goal_rot.clone()
    assert env.step(actions).score.value.tolist() == [1.0, 0.0]
    after = env.step(actions).state["goal_rot"]
    assert not torch.equal(after[0], before[0]) and torch.equal(after[1], before[1])


def test_a_person_sets_how_near_is_near_enough():
    own, wide = "shadow_hand_spin", "shadow_hand_spin+tolerance=0.5"
    tolerances = [registry.make(env, worlds=1).task.tolerance for env in (own, wide)]
    assert tolerances == [pytest.approx(0.156, abs=1e-3), 0.5]
    programs = [human.program(get(env)) for env in (own, wide)]
    assert "TOLERANCE = 0.0" in programs[0] and "TOLERANCE = 0.5" in programs[1]


@PENS
def test_the_human_reward_pays_for_what_the_task_counts(task: type[PenInHand]):
    env = registry.make(f"{task.env}+tolerance=0.3", worlds=2)
    near = {name: torch.zeros(2, size) for name, size in (("object_pos", 3), ("goal_pos", 3), ("actions", 20))}
    paid = env.task.human_reward({**near, "rotation_distance": torch.tensor([0.29, 0.31])})
    assert paid.tolist() == pytest.approx([250.0 + 1 / 0.39, 1 / 0.41])
