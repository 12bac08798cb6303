import math

import pytest

from openeureka.suite.dexterity.switch import ShadowHandSwitchAsPublished

from .worlds import fresh, press, scored, state_with

SWITCH = "shadow_hand_switch"
PUBLISHED = f"{ShadowHandSwitchAsPublished.__module__}:{ShadowHandSwitchAsPublished.__name__}"


def rockers(right: float, left: float) -> dict[str, list[float]]:
    return {"switch_right_rocker": [right], "switch_left_rocker": [left]}


def test_the_rockers_stay_raised_and_rise_again_when_they_are_let_go() -> None:
    simulation = fresh(SWITCH)
    raised = simulation.current_state()["switch_right_handle_pos"][0, 2]
    low = state_with(simulation, rockers(0.0, 0.0))["switch_right_handle_pos"][0, 2]
    assert float(raised - low) == pytest.approx(0.02 * math.sin(0.5585), abs=1e-4)  # 0.0106 m
    for side in ("right", "left"):
        assert "sinks by about 1 cm" in simulation.task.spec[f"switch_{side}_handle_pos"].meaning
    state = press(simulation, {}, steps=60)
    assert float(state["switch_right_handle_pos"][0, 2]) == pytest.approx(float(raised), abs=1e-3)


def test_the_published_threshold_is_out_of_reach() -> None:
    simulation = fresh(PUBLISHED)
    assert scored(simulation, state_with(simulation, rockers(0.0, 0.0))) == [0.0]
    beyond = state_with(simulation, rockers(-1.1, -1.1))  # 0.0166 + 2 * 0.02 * sin(1.1) = 0.052, far below the stop
    assert scored(simulation, beyond) == [1.0]
