import math

import pytest

from openeureka.suite.dexterity.common import distance, finger_distances

from .worlds import fresh, press, scored, state_with, with_fingers_at

KETTLE = "shadow_hand_kettle"


def bucket(x: float, y: float, z: float) -> dict[str, list[float]]:
    return {"bucket": [x, y, z, 1.0, 0.0, 0.0, 0.0]}


def test_the_hands_start_where_the_originals_do() -> None:
    turned = [math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)]
    start = {"object": [0.0, 0.0, 0.5, *turned]} | bucket(0.0, -0.3, 0.5)  # in the original, both fall at first
    state = state_with(fresh(KETTLE), start)
    for side, point, fingers in (("right", "kettle_handle_pos", 0.825), ("left", "bucket_handle_pos", 1.151)):
        assert float(finger_distances(state, side, state[point])) == pytest.approx(fingers, abs=0.01)
    assert float(distance(state["kettle_spout_pos"], state["bucket_handle_pos"])) == pytest.approx(0.197, abs=0.002)


def test_kettle_and_bucket_stand_still() -> None:
    simulation = fresh(KETTLE)
    start = simulation.current_state()
    state = press(simulation, {}, steps=20)
    for name in ("kettle_handle_pos", "bucket_handle_pos"):
        assert float(distance(start[name], state[name])) < 2e-3


# The spout is at (0, -0.2, 0.544), the bucket's point 0.1 m below its origin.
@pytest.mark.parametrize(("y", "expected"), [(-0.155, 1.0), (-0.145, 0.0)])
def test_the_bucket_is_at_the_spout_within_five_centimetres(y: float, expected: float) -> None:
    simulation = fresh(KETTLE)
    assert scored(simulation, state_with(simulation, bucket(0.0, y, 0.644))) == [expected]


@pytest.mark.parametrize(("height", "expected"), [(0.29, True), (0.31, False)])
def test_a_dropped_bucket_ends_the_episode(height: float, expected: bool) -> None:
    simulation = fresh(KETTLE)
    assert simulation.task.terminated(state_with(simulation, bucket(0.6, -0.3, height))).tolist() == [expected]


@pytest.mark.parametrize(
    ("offset", "expected"),
    [(0.1, 1.0 - 0.5 - 0.5 + 0.5 - 2 * 0.1), (0.15, 1.0 - 0.75 - 0.75)],
)
def test_human_reward_pays_for_the_spouts_approach_only_when_both_hands_hold(offset: float, expected: float) -> None:
    simulation = fresh(KETTLE)
    state = state_with(simulation, bucket(0.0, -0.3, 0.644))
    points = {"right": state["kettle_handle_pos"], "left": state["bucket_handle_pos"]}
    reward = simulation.task.human_reward(with_fingers_at(state, offset, **points))
    assert float(reward) == pytest.approx(expected, abs=2e-3)
