import math
import re

import pytest

from openeureka.suite.dexterity.common import distance, finger_distances
from openeureka.suite.dexterity.grasp_and_place import ShadowHandGraspAndPlace
from openeureka.suite.dexterity.objects import Bucket, Cube

from .worlds import fresh, let_go, press, scored, state_with, with_fingers_at

PLACE = "shadow_hand_grasp_and_place"


def at(name: str, y: float, z: float) -> dict[str, list[float]]:
    return {name: [0.0, y, z, 1.0, 0.0, 0.0, 0.0]}


def test_the_hands_start_where_the_originals_do() -> None:
    # The original starts both things inside the table.
    state = state_with(fresh(PLACE), at("object", 0.2, 0.6) | at("block", -0.2, 0.6))
    for side in ("right", "left"):
        handle = state[f"block_{side}_handle_pos"]
        assert float(distance(state[f"{side}_hand_pos"], handle)) == pytest.approx(0.262, abs=0.003)
        assert float(finger_distances(state, side, handle)) == pytest.approx(1.178, abs=0.01)


def test_the_model_is_told_what_has_to_fit_into_what() -> None:
    scene, spec = ShadowHandGraspAndPlace.scene, ShadowHandGraspAndPlace.spec
    bucket, block = scene.things["object"].thing, scene.things["block"].thing
    assert isinstance(bucket, Bucket) and isinstance(block, Cube)
    sizes = (bucket.top - bucket.bottom, 2 * bucket.top_radius, block.edge)
    told = spec["block_right_handle_pos"].meaning, spec["block_left_handle_pos"].meaning
    metres = [float(number) / 100 for number in re.findall(r"(\d+) cm", " ".join(told))]
    assert metres == pytest.approx(sizes, abs=0.005)


def test_bucket_and_block_start_at_rest() -> None:
    simulation = fresh(PLACE)
    start = simulation.current_state()
    state = press(simulation, {}, steps=20)
    for name in ("block_right_handle_pos", "block_left_handle_pos"):
        assert float(distance(start[name], state[name])) < 2e-3


def test_the_block_fits_into_the_bucket() -> None:
    simulation = fresh(PLACE)
    state_with(simulation, at("block", 0.2, 0.75))
    state = let_go(simulation, steps=40)
    inside = state["block_left_handle_pos"] - state["block_right_handle_pos"]
    assert float(inside[0, :2].norm()) < 0.02 and abs(float(inside[0, 2])) < 0.04


# The bucket is at y = 0.2, 0.028 above the middle of the block: sqrt(0.19^2 + 0.028^2) = 0.192
@pytest.mark.parametrize(("y", "expected"), [(0.01, 1.0), (-0.01, 0.0)])
def test_the_block_is_placed_within_twenty_centimetres_of_the_bucket(y: float, expected: float) -> None:
    simulation = fresh(PLACE)
    assert scored(simulation, state_with(simulation, at("block", y, 0.625))) == [expected]


@pytest.mark.parametrize(("offset", "expected"), [(0.29, False), (0.31, True)])
def test_the_episode_ends_when_a_hand_leaves_its_thing(offset: float, expected: bool) -> None:
    simulation = fresh(PLACE)
    state = simulation.current_state()
    state = with_fingers_at(state, offset, right=state["block_right_handle_pos"])
    assert simulation.task.terminated(state).tolist() == [expected]


def test_human_reward_grows_as_fingers_and_things_come_together() -> None:
    simulation = fresh(PLACE)
    state = state_with(simulation, at("object", 0.2, 0.653) | at("block", 0.1, 0.653))
    state = with_fingers_at(state, 0.02, right=state["block_right_handle_pos"], left=state["block_left_handle_pos"])
    # Five fingers 0.02 m away each, 0.1 m between the things: exp(-1) + exp(-1) + 2 exp(-1)
    assert float(simulation.task.human_reward(state)) == pytest.approx(4.0 * math.exp(-1.0), rel=1e-3)
