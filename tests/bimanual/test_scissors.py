import math

import pytest

from openeureka.suite.dexterity.common import distance
from openeureka.suite.dexterity.scissors import CRUSHED, NEAR

from .worlds import fresh, press, scored, state_with, with_fingers_at

SCISSORS = "shadow_hand_scissors"


def test_the_scissors_lie_still() -> None:
    simulation = fresh(SCISSORS)
    start = simulation.current_state()
    state = press(simulation, {}, steps=100)
    for side in ("right", "left"):
        assert float(distance(start[f"scissors_{side}_handle_pos"], state[f"scissors_{side}_handle_pos"])) < 3e-3


def test_opening_counts_however_the_scissors_lie() -> None:
    simulation = fresh(SCISSORS)
    turned = [math.cos(1.0), 0.6 * math.sin(1.0), 0.0, 0.8 * math.sin(1.0)]
    joints = {"object": [0.0, 0.0, 1.0, *turned], "scissors_hinge": [-0.31]}
    assert scored(simulation, state_with(simulation, joints)) == [0.0]
    assert scored(simulation, state_with(simulation, joints | {"scissors_hinge": [-0.29]})) == [1.0]


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
