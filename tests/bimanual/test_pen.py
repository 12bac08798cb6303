from openeureka.suite.dexterity.common import distance

from .worlds import fresh, press

PEN = "shadow_hand_pen"


def test_the_pen_lies_still_and_closed() -> None:
    simulation = fresh(PEN)
    start = simulation.current_state()
    state = press(simulation, {}, steps=20)
    for side in ("right", "left"):
        assert float(distance(start[f"pen_{side}_handle_pos"], state[f"pen_{side}_handle_pos"])) < 5e-3
