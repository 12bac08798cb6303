import math

import pytest

from openeureka.suite.dexterity.common import distance, finger_distances
from openeureka.suite.dexterity.switch import ShadowHandSwitchAsPublished

from .worlds import fresh, press, scored, state_with, with_fingers_at

SWITCH = "shadow_hand_switch"
PUBLISHED = f"{ShadowHandSwitchAsPublished.__module__}:{ShadowHandSwitchAsPublished.__name__}"


def rockers(right: float, left: float) -> dict[str, list[float]]:
    return {"switch_right_rocker": [right], "switch_left_rocker": [left]}


def test_the_hands_start_where_the_originals_do() -> None:
    state = fresh(PUBLISHED).current_state()
    for side in ("right", "left"):
        handle = state[f"switch_{side}_handle_pos"]
        assert float(distance(state[f"{side}_hand_pos"], handle)) == pytest.approx(0.179, abs=0.003)
        assert float(finger_distances(state, side, handle)) == pytest.approx(0.716, abs=0.01)


def test_the_rockers_stay_raised_and_rise_again_when_they_are_let_go() -> None:
    simulation = fresh(SWITCH)
    raised = simulation.current_state()["switch_right_handle_pos"][0, 2]
    low = state_with(simulation, rockers(0.0, 0.0))["switch_right_handle_pos"][0, 2]
    assert float(raised - low) == pytest.approx(0.02 * math.sin(0.5585), abs=1e-4)
    state = press(simulation, {}, steps=60)
    assert float(state["switch_right_handle_pos"][0, 2]) == pytest.approx(float(raised), abs=1e-3)


# At 0.2 rad, both ends together are 0.0166 - 2 * 0.02 * sin(0.2) = 0.0087 m below their marks; at 0.1 rad 0.0126 m.
@pytest.mark.parametrize(
    ("right", "left", "expected"), [(0.5585, 0.5585, 0.0), (0.2, 0.2, 0.0), (0.0, 0.5585, 0.0), (0.1, 0.1, 1.0)]
)
def test_both_switches_must_be_pressed_down(right: float, left: float, expected: float) -> None:
    simulation = fresh(SWITCH)
    assert scored(simulation, state_with(simulation, rockers(right, left))) == [expected]


def test_the_published_threshold_is_out_of_reach() -> None:
    simulation = fresh(PUBLISHED)
    assert scored(simulation, state_with(simulation, rockers(0.0, 0.0))) == [0.0]
    beyond = state_with(simulation, rockers(-1.1, -1.1))  # 0.0166 + 2 * 0.02 * sin(1.1) = 0.052, far below the stop
    assert scored(simulation, beyond) == [1.0]


def test_episodes_end_by_time_only() -> None:
    simulation = fresh(SWITCH)
    state = simulation.current_state()
    state = with_fingers_at(state, 9.0, right=state["switch_right_handle_pos"], left=state["switch_left_handle_pos"])
    assert simulation.task.terminated(state).tolist() == [False]


def test_human_reward_pays_for_reaching_and_pressing() -> None:
    simulation = fresh(SWITCH)
    state = state_with(simulation, rockers(0.1, 0.1))
    state = with_fingers_at(state, 0.1, right=state["switch_right_handle_pos"], left=state["switch_left_handle_pos"])
    # 2 - 0.5 - 0.5 + 50 * 0.0126
    assert float(simulation.task.human_reward(state)) == pytest.approx(1.63, abs=0.03)
