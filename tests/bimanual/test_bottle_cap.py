import math

import pytest

from openeureka.suite.dexterity.common import distance, finger_distances

from .worlds import fresh, state_with

BOTTLE = "shadow_hand_bottle_cap"


def bottle(x: float, z: float, pitch: float = -0.7) -> dict[str, list[float]]:
    return {"object": [x, -0.6, z, math.cos(pitch / 2), 0.0, math.sin(pitch / 2), 0.0]}


def test_the_hands_start_where_the_originals_do() -> None:
    state = state_with(fresh(BOTTLE), bottle(0.0, 0.5))  # the original starts the bottle inside the palm
    assert float(distance(state["bottle_cap_pos"], state["right_hand_pos"])) == pytest.approx(0.164, abs=0.003)
    assert float(distance(state["bottle_pos"], state["left_hand_pos"])) == pytest.approx(0.049, abs=0.003)
    assert float(finger_distances(state, "right", state["bottle_cap_pos"])) == pytest.approx(0.806, abs=0.01)
