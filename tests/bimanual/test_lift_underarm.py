import pytest

from openeureka.suite.dexterity.common import distance

from .worlds import fresh, press, state_with

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
