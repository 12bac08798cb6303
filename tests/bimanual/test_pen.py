import pytest

from openeureka.suite.dexterity.common import distance, finger_distances

from .worlds import fresh, press, scored, state_with, with_fingers_at

PEN = "shadow_hand_pen"


def test_the_hands_start_where_the_originals_do() -> None:
    state = state_with(fresh(PEN), {"object": [0.0, 0.0, 0.6, 0.5, 0.5, 0.5, -0.5]})  # in the original, in the table
    for side, palm, fingers in (("right", 0.280, 1.245), ("left", 0.292, 1.382)):
        handle = state[f"pen_{side}_handle_pos"]
        assert float(distance(state[f"{side}_hand_pos"], handle)) == pytest.approx(palm, abs=0.003)
        assert float(finger_distances(state, side, handle)) == pytest.approx(fingers, abs=0.01)


def test_the_pen_lies_still_and_closed() -> None:
    simulation = fresh(PEN)
    start = simulation.current_state()
    state = press(simulation, {}, steps=20)
    for side in ("right", "left"):
        assert float(distance(start[f"pen_{side}_handle_pos"], state[f"pen_{side}_handle_pos"])) < 5e-3


# 0.17 m between the points when closed.
@pytest.mark.parametrize(("slide", "expected"), [(0.0, 0.0), (0.12, 0.0), (0.14, 1.0)])
def test_the_cap_is_off_when_the_points_to_grasp_are_thirty_centimetres_apart(slide: float, expected: float) -> None:
    simulation = fresh(PEN)
    assert scored(simulation, state_with(simulation, {"pen_cap_slide": [slide]})) == [expected]


@pytest.mark.parametrize(("offset", "expected"), [(0.29, False), (0.31, True)])
def test_the_episode_ends_when_a_hand_leaves_the_pen(offset: float, expected: bool) -> None:
    simulation = fresh(PEN)
    state = simulation.current_state()
    state = with_fingers_at(state, offset, left=state["pen_left_handle_pos"])
    assert simulation.task.terminated(state).tolist() == [expected]


@pytest.mark.parametrize(
    ("offset", "expected"),
    [
        (0.1, 2 * 0.00674 + 5 * 0.27 - 0.8),  # exp(-10 * 0.5) for each hand
        (0.2, 2 * 0.0000454),  # exp(-10 * 1.0)
    ],
)
def test_human_reward_pays_for_pulling_only_when_both_hands_are_at_the_pen(offset: float, expected: float) -> None:
    simulation = fresh(PEN)
    state = state_with(simulation, {"pen_cap_slide": [0.1]})
    state = with_fingers_at(state, offset, right=state["pen_right_handle_pos"], left=state["pen_left_handle_pos"])
    assert float(simulation.task.human_reward(state)) == pytest.approx(expected, abs=1e-3)
