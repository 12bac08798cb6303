import math

import pytest
import torch

from openeureka.suite.dexterity.common import distance, finger_distances

from .worlds import fresh, press, scored, state_with

CUP = "shadow_hand_swing_cup"


def cup(yaw: float, height: float = 0.684) -> dict[str, list[float]]:
    return {"object": [0.0, 0.0, height, math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]}


def test_the_hands_start_where_the_originals_do() -> None:
    state = state_with(fresh(CUP), cup(math.pi / 2, height=0.6))  # the original starts the cup inside the table
    for side, palm, fingers in (("right", 0.238, 1.445), ("left", 0.239, 1.296)):
        handle = state[f"cup_{side}_handle_pos"]
        assert float(distance(state[f"{side}_hand_pos"], handle)) == pytest.approx(palm, abs=0.003)
        assert float(finger_distances(state, side, handle)) == pytest.approx(fingers, abs=0.01)


def test_the_cup_starts_on_the_table_half_a_turn_from_its_goal() -> None:
    simulation = fresh(CUP)
    start = simulation.current_state()
    assert float(start["rotation_distance"]) == pytest.approx(math.pi, abs=1e-3)
    state = press(simulation, {}, steps=30)
    assert float(distance(start["object_pos"], state["object_pos"])) < 2e-3


@pytest.mark.parametrize(("left", "expected"), [(0.77, 1.0), (0.80, 0.0)])
def test_the_cup_is_turned_within_45_degrees_of_the_goal(left: float, expected: float) -> None:
    simulation = fresh(CUP)
    state = state_with(simulation, cup(-math.pi / 2 + left))
    assert float(state["rotation_distance"]) == pytest.approx(left, abs=1e-4)
    assert scored(simulation, state) == [expected]


@pytest.mark.parametrize(("height", "expected"), [(0.29, True), (0.31, False)])
def test_a_dropped_cup_ends_the_episode(height: float, expected: bool) -> None:
    simulation = fresh(CUP)
    state = state_with(simulation, cup(0.0, height))
    assert simulation.task.terminated(state).tolist() == [expected]


def test_human_reward_pays_for_turning_only_when_both_hands_are_at_the_handles() -> None:
    simulation = fresh(CUP)
    state = dict(state_with(simulation, cup(-math.pi / 2 + 0.4)))
    right, left = (finger_distances(state, side, state[f"cup_{side}_handle_pos"]) for side in ("right", "left"))
    assert torch.allclose(simulation.task.human_reward(state), -right - left)
    for side in ("right", "left"):
        for finger in ("ff", "mf", "rf", "lf", "th"):
            state[f"{side}_hand_{finger}_pos"] = state[f"cup_{side}_handle_pos"]
    assert float(simulation.task.human_reward(state)) == pytest.approx(1.0, abs=1e-3)  # 1 / (0.4 + 0.1) - 1
