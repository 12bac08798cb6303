import re

import pytest
import torch

from openeureka.suite.dexterity.common import distance
from openeureka.suite.dexterity.kettle import ShadowHandKettle
from openeureka.suite.dexterity.objects import Bucket

from .worlds import fresh, press

KETTLE = "shadow_hand_kettle"


def test_the_model_is_told_where_the_spout_should_come() -> None:
    state, scene = fresh(KETTLE).current_state(), ShadowHandKettle.scene
    bucket, point = state["bucket_pos"][0], state["bucket_handle_pos"][0]
    thing, table = scene.things["bucket"].thing, scene.table
    assert isinstance(thing, Bucket) and table
    told = ShadowHandKettle.spec["bucket_handle_pos"].meaning
    metres = [float(number) / 100 for number in re.findall(r"(\d+) cm", told)]
    sizes = (float(bucket[2] - point[2]), thing.top - thing.bottom, 2 * thing.top_radius)
    assert metres == pytest.approx(sizes, abs=0.005) and torch.equal(bucket[:2], point[:2])
    ranges = zip(point, table.size, (*table.centre, table.size[2] / 2), strict=True)
    assert all(abs(float(place) - middle) < size / 2 for place, size, middle in ranges)


def test_kettle_and_bucket_stand_still() -> None:
    simulation = fresh(KETTLE)
    start = simulation.current_state()
    state = press(simulation, {}, steps=20)
    for name in ("kettle_handle_pos", "bucket_handle_pos"):
        assert float(distance(start[name], state[name])) < 2e-3
