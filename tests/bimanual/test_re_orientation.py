import math

import torch

from openeureka.tasks.env import BatchedEnv
from openeureka.tasks.rotations import rotation_distance

from .worlds import fresh, judged, scored, state_with

CUBES = "shadow_hand_re_orientation"
PLACES = {"object": [0.0, -0.39, 0.60], "object_another": [0.0, -0.76, 0.60]}


def cubes(simulation: BatchedEnv, **angles: float) -> dict[str, list[float]]:
    """Poses of cubes at their start positions, each turned from the goal about the world's z axis by an angle [rad]."""
    x, y, z, w = simulation.current_state()["goal_rot"][0].tolist()
    joints = {}
    for name, angle in angles.items():
        c, s = math.cos(angle / 2), math.sin(angle / 2)
        turned = [c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w]
        joints[name] = [*PLACES[name], *turned]
    return joints


def test_both_cubes_start_alike_over_their_palms_and_share_a_goal() -> None:
    simulation = fresh(CUBES, worlds=32)
    state = simulation.current_state()
    offsets = [state[f"{name}_pos"] - torch.tensor(place) for name, place in PLACES.items()]
    assert torch.allclose(offsets[0], offsets[1], atol=1e-6)
    assert float(offsets[0].abs().max()) <= 0.01 + 1e-6 and float(offsets[0].std(dim=0).min()) > 0.003
    assert torch.allclose(state["object_rot"], state["object_another_rot"], atol=1e-6)
    assert torch.equal(state["goal_rot"], state["goal_another_rot"])
    assert torch.allclose(state["goal_another_pos"], torch.tensor([0.0, -0.76, 0.56]))
    assert float(state["rotation_distance"].std()) > 0.3


def test_goals_count_until_the_episode_ends() -> None:
    simulation = fresh(CUBES, worlds=2)
    there = state_with(simulation, cubes(simulation, object=0.0, object_another=1.0))
    assert scored(simulation, there)[0] == 1.0
    assert scored(simulation, there)[0] == 2.0
    simulation.task.reset(torch.tensor([1]))
    away = state_with(simulation, cubes(simulation, object=1.0, object_another=1.0))
    assert scored(simulation, away)[0] == 2.0
    assert simulation.task.sparse_reward(judged(simulation, away))[0] == 0.0


def test_a_reached_goal_gives_way_to_a_new_one_of_both_cubes_in_its_world_only() -> None:
    simulation = fresh(CUBES, worlds=2)
    before = simulation.current_state()
    at_the_first_worlds_goal = state_with(simulation, cubes(simulation, object=0.0, object_another=1.0))
    scored(simulation, at_the_first_worlds_goal)
    after = simulation.step(torch.zeros(2, 40)).state
    changed = rotation_distance(before["goal_rot"], after["goal_rot"])
    assert float(changed[0]) > 0.1 and float(changed[1]) < 1e-3
    assert torch.equal(after["goal_rot"], after["goal_another_rot"])
