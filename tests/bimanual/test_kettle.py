from openeureka.suite.dexterity.common import distance

from .worlds import fresh, press

KETTLE = "shadow_hand_kettle"


def test_kettle_and_bucket_stand_still() -> None:
    simulation = fresh(KETTLE)
    start = simulation.current_state()
    state = press(simulation, {}, steps=20)
    for name in ("kettle_handle_pos", "bucket_handle_pos"):
        assert float(distance(start[name], state[name])) < 2e-3
