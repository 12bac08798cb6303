import math

import pytest
import torch

from openeureka.suite.dexterity.common import distance, finger_distances

from .worlds import fresh, scored, state_with, with_fingers_at

BOTTLE = "shadow_hand_bottle_cap"


def bottle(x: float, z: float, pitch: float = -0.7) -> dict[str, list[float]]:
    return {"object": [x, -0.6, z, math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0]}


def test_the_hands_start_where_the_originals_do() -> None:
    state = state_with(fresh(BOTTLE), bottle(0.0, 0.5))  # the original starts the bottle inside the palm
    assert float(distance(state["bottle_cap_pos"], state["right_hand_pos"])) == pytest.approx(0.164, abs=0.003)
    assert float(distance(state["bottle_pos"], state["left_hand_pos"])) == pytest.approx(0.049, abs=0.003)
    assert float(finger_distances(state, "right", state["bottle_cap_pos"])) == pytest.approx(0.806, abs=0.01)


# The cap's point is 0.0103 m beside the bottle's: a slide of 0.027 takes it sqrt(0.0103^2 + 0.027^2) = 0.029 off.
@pytest.mark.parametrize(("slide", "expected"), [(0.0, 0.0), (0.027, 0.0), (0.029, 1.0)])
def test_the_cap_is_off_three_centimetres_from_the_bottle(slide: float, expected: float) -> None:
    simulation = fresh(BOTTLE)
    assert scored(simulation, state_with(simulation, {"bottle_cap_slide": [slide]})) == [expected]


@pytest.mark.parametrize(
    ("joints", "expected"),
    [
        ({}, False),
        (bottle(0.0, 0.5, pitch=-1.6), True),  # the mouth sinks to 0.496 m
        ({"left_base_y": [0.2]}, True),
        ({"right_base_x": [0.6]}, True),
    ],
)
def test_a_hand_that_leaves_or_a_bottle_that_falls_ends_the_episode(joints: dict, expected: bool) -> None:
    simulation = fresh(BOTTLE)
    assert simulation.task.terminated(state_with(simulation, joints)).tolist() == [expected]


@pytest.mark.parametrize(
    ("offset", "expected"),
    [
        (0.05, 2.0 - 0.25 - 0.1 + 30 * 0.0103),
        (0.07, 2.0 - 0.35 - 0.1),
    ],
)
def test_human_reward_pays_for_lifting_only_when_the_fingers_are_at_the_cap(offset: float, expected: float) -> None:
    simulation = fresh(BOTTLE)
    state = simulation.current_state()
    state = with_fingers_at(state, offset, right=state["bottle_cap_pos"])
    state["left_hand_pos"] = state["bottle_pos"] + torch.tensor([0.0, 0.1, 0.0])
    assert float(simulation.task.human_reward(state)) == pytest.approx(expected, abs=2e-3)
