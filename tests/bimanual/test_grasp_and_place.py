import re

import pytest

from openeureka.suite.dexterity.common import distance
from openeureka.suite.dexterity.grasp_and_place import ShadowHandGraspAndPlace
from openeureka.suite.dexterity.objects import Bucket, Cube

from .worlds import fresh, let_go, press, state_with

PLACE = "shadow_hand_grasp_and_place"


def at(name: str, y: float, z: float) -> dict[str, list[float]]:
    return {name: [0.0, y, z, 1.0, 0.0, 0.0, 0.0]}


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
