import math

import pytest

from openeureka.suite.dexterity.common import distance, finger_distances
from openeureka.suite.dexterity.scissors import CRUSHED, NEAR

from .worlds import fresh, press, scored, state_with, with_fingers_at

SCISSORS = "shadow_hand_scissors"


def test_the_hands_start_where_the_originals_do() -> None:
    turned = [math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)]
    state = state_with(fresh(SCISSORS), {"object": [0.0, 0.0, 0.6, *turned]})  # in the original, inside the table
    for side, palm, fingers in (("right", 0.301, 1.534), ("left", 0.217, 1.262)):
        handle = state[f"scissors_{side}_handle_pos"]
        assert float(distance(state[f"{side}_hand_pos"], handle)) == pytest.approx(palm, abs=0.003)
        assert float(finger_distances(state, side, handle)) == pytest.approx(fingers, abs=0.015)


def test_the_scissors_lie_still() -> None:
    simulation = fresh(SCISSORS)
    start = simulation.current_state()
    state = press(simulation, {}, steps=100)
    for side in ("right", "left"):
        assert float(distance(start[f"scissors_{side}_handle_pos"], state[f"scissors_{side}_handle_pos"])) < 3e-3


@pytest.mark.parametrize(("angle", "expected"), [(-0.59, 0.0), (-0.31, 0.0), (-0.29, 1.0), (0.3, 1.0)])
def test_the_scissors_are_open_when_the_hinge_has_turned_by_0_29_rad(angle: float, expected: float) -> None:
    simulation = fresh(SCISSORS)
    assert scored(simulation, state_with(simulation, {"scissors_hinge": [angle]})) == [expected]


def test_opening_counts_however_the_scissors_lie() -> None:
    simulation = fresh(SCISSORS)
    turned = [math.cos(1.0), 0.6 * math.sin(1.0), 0.0, 0.8 * math.sin(1.0)]
    joints = {"object": [0.0, 0.0, 1.0, *turned], "scissors_hinge": [-0.31]}
    assert scored(simulation, state_with(simulation, joints)) == [0.0]
    assert scored(simulation, state_with(simulation, joints | {"scissors_hinge": [-0.29]})) == [1.0]


@pytest.mark.parametrize(("offset", "expected"), [(0.34, False), (0.36, True)])
def test_the_episode_ends_when_a_hand_leaves_its_handle(offset: float, expected: bool) -> None:
    simulation = fresh(SCISSORS)
    state = simulation.current_state()
    state = with_fingers_at(state, offset, right=state["scissors_right_handle_pos"])
    assert simulation.task.terminated(state).tolist() == [expected]


@pytest.mark.parametrize(
    ("offset", "hinge", "expected"), [(0.13, -0.7, True), (0.13, -0.68, False), (0.15, -0.7, False)]
)
def test_the_episode_ends_when_held_blades_are_crushed_and_the_prompt_says_so(
    offset: float, hinge: float, expected: bool
) -> None:
    simulation = fresh(SCISSORS)
    state = state_with(simulation, {"scissors_hinge": [hinge]})
    handles = {side: state[f"scissors_{side}_handle_pos"] for side in ("right", "left")}
    assert simulation.task.terminated(with_fingers_at(state, offset, **handles)).tolist() == [expected]
    assert f"less than {NEAR} m and the blades are pressed past closed, the hinge below {CRUSHED} rad" in (
        simulation.task.ends
    )


@pytest.mark.parametrize(
    ("offset", "expected"),
    [(0.1, 2.0 - 0.5 - 0.5 + 5 * 0.19), (0.15, 2.0 - 0.75 - 0.75)],
)
def test_human_reward_pays_for_opening_only_when_both_hands_are_at_the_handles(offset: float, expected: float) -> None:
    simulation = fresh(SCISSORS)
    state = state_with(simulation, {"scissors_hinge": [-0.4]})
    handles = {side: state[f"scissors_{side}_handle_pos"] for side in ("right", "left")}
    reward = simulation.task.human_reward(with_fingers_at(state, offset, **handles))
    assert float(reward) == pytest.approx(expected, abs=1e-3)
