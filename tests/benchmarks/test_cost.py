"""The parts of the cost of training add up to no more than the whole."""

import cost
import pytest


def test_the_parts_of_a_training_step_are_within_its_cost():
    found = cost.measure("cartpole", worlds=8, repeats=1)
    assert found["worlds_per_lane"] == 8 and found["lanes"] == cost.LANES
    (whole,) = found["training_us"]
    assert min(found["parts_us"].values()) > 0.0
    assert sum(found["parts_us"].values()) <= 1.01 * whole  # each part is some hundreds, rounded to 0.1
    assert found["training_over_bare_speed"] == pytest.approx(found["bare_us"][0] / whole, rel=0.05)
