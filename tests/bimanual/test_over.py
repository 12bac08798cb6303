import math

import pytest
import torch

from .worlds import fresh, scored, state_with

OVER = "shadow_hand_over"
UNTURNED = [1.0, 0.0, 0.0, 0.0]


def test_the_egg_starts_over_the_right_palm_in_any_orientation() -> None:
    state = fresh(OVER, worlds=64).current_state()
    offset = state["object_pos"] - torch.tensor([0.0, -0.39, 0.54])
    assert float(offset.abs().max()) <= 0.01 + 1e-6 and float(offset.std(dim=0).min()) > 0.003
    assert torch.equal(state["goal_pos"], torch.tensor([0.0, -0.64, 0.54]).expand(64, 3))
    assert float(state["rotation_distance"].std()) > 0.3


@pytest.mark.parametrize(("height", "expected"), [(0.565, 1.0), (0.575, 0.0)])
def test_the_egg_is_caught_within_three_centimetres_of_the_goal(height: float, expected: float) -> None:
    simulation = fresh(OVER)
    state = state_with(simulation, {"object": [0.0, -0.64, height, *UNTURNED]})
    assert scored(simulation, state) == [expected]


@pytest.mark.parametrize(("height", "expected"), [(0.19, True), (0.21, False)])
def test_a_dropped_egg_ends_the_episode(height: float, expected: bool) -> None:
    simulation = fresh(OVER)
    state = state_with(simulation, {"object": [0.0, -0.5, height, *UNTURNED]})
    assert simulation.task.terminated(state).tolist() == [expected]


def test_human_reward_falls_with_distance_and_angle() -> None:
    simulation = fresh(OVER)
    state = dict(state_with(simulation, {"object": [0.0, -0.74, 0.54, *UNTURNED]}))
    state["rotation_distance"] = torch.tensor([0.5])
    # 0.1 m and 0.5 rad: exp(-0.2 * (50 * 0.1 + 0.5)) = exp(-1.1)
    assert float(simulation.task.human_reward(state)) == pytest.approx(math.exp(-1.1), rel=1e-4)
