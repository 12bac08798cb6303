import math

import pytest

from openeureka.suite.dexterity.common import distance

from .worlds import fresh, press

CUP = "shadow_hand_swing_cup"


def test_the_cup_starts_on_the_table_half_a_turn_from_its_goal() -> None:
    simulation = fresh(CUP)
    start = simulation.current_state()
    assert float(start["rotation_distance"]) == pytest.approx(math.pi, abs=1e-3)
    state = press(simulation, {}, steps=30)
    assert float(distance(start["object_pos"], state["object_pos"])) < 2e-3
