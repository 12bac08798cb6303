import pytest
import torch

from openeureka.suite.dexterity.common import distance

from .worlds import fresh, press, scored, state_with

LIFT = "shadow_hand_lift_underarm"


def pot(height: float) -> dict[str, list[float]]:
    return {"object": [0.0, -0.6, height, 1.0, 0.0, 0.0, 0.0]}


def test_the_hands_start_where_the_originals_do() -> None:
    state = state_with(fresh(LIFT), pot(0.45))  # the original starts the pot inside the table
    for side in ("right", "left"):  # forward kinematics of the originals
        gap = distance(state[f"{side}_hand_pos"], state[f"pot_{side}_handle_pos"])
        assert float(gap) == pytest.approx(0.139, abs=0.003)


def test_the_pot_stands_on_the_table() -> None:
    simulation = fresh(LIFT)
    start = simulation.current_state()
    assert float(distance(start["object_pos"], start["goal_pos"])) == pytest.approx(0.385, abs=1e-3)
    state = press(simulation, {}, steps=60)
    assert float(distance(start["object_pos"], state["object_pos"])) < 3e-3  # the contact gives way by 2.5 mm


@pytest.mark.parametrize(("height", "expected"), [(0.81, 1.0), (0.79, 0.0), (0.89, 1.0), (0.91, 0.0)])
def test_the_pot_is_lifted_within_five_centimetres_of_the_goal(height: float, expected: float) -> None:
    simulation = fresh(LIFT)
    assert scored(simulation, state_with(simulation, pot(height))) == [expected]


@pytest.mark.parametrize(("right", "left", "expected"), [(0.19, 0.19, False), (0.21, 0.0, True), (0.0, 0.21, True)])
def test_the_episode_ends_when_a_palm_leaves_its_handle(right: float, left: float, expected: bool) -> None:
    simulation = fresh(LIFT)
    state = dict(simulation.current_state())
    for side, gap in (("right", right), ("left", left)):
        state[f"{side}_hand_pos"] = state[f"pot_{side}_handle_pos"] + torch.tensor([gap, 0.0, 0.0])
    assert simulation.task.terminated(state).tolist() == [expected]


@pytest.mark.parametrize(("height", "expected"), [(0.29, True), (0.31, False)])
def test_a_dropped_pot_ends_the_episode(height: float, expected: bool) -> None:
    simulation = fresh(LIFT)
    state = dict(state_with(simulation, pot(height)))
    for side in ("right", "left"):
        state[f"{side}_hand_pos"] = state[f"pot_{side}_handle_pos"]
    assert simulation.task.terminated(state).tolist() == [expected]


def test_human_reward_pays_for_lifting_only_when_both_palms_are_at_the_handles() -> None:
    simulation = fresh(LIFT)
    state = dict(state_with(simulation, pot(0.665)))  # 0.185 m below the goal
    for side, gap in (("right", 0.05), ("left", 0.09)):
        state[f"{side}_hand_pos"] = state[f"pot_{side}_handle_pos"] + torch.tensor([gap, 0.0, 0.0])
    assert float(simulation.task.human_reward(state)) == pytest.approx(0.2 - 0.05 - 0.09, abs=1e-4)
    state["left_hand_pos"] = state["pot_left_handle_pos"] + torch.tensor([0.07, 0.0, 0.0])
    # 0.2 - 0.05 - 0.07 + 3 * (0.385 - 0.185)
    assert float(simulation.task.human_reward(state)) == pytest.approx(0.68, abs=1e-4)
