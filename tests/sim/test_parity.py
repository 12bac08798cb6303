"""MuJoCo Warp against MuJoCo, on tasks that between them use most features; `benchmarks/gpu.py` compares all tasks."""

import pytest

from openeureka.testing.conformance.parity import compare

pytest.importorskip("mujoco_warp", reason="pip install 'openeureka[gpu]'")
pytestmark = pytest.mark.timeout(900)  # a minute of compilation on a quiet machine

# Float32 against float64, after one control step; forces of stiff contacts are the least exact.
MEDIAN, USUAL = 2e-5, 1e-3


@pytest.mark.parametrize("env", ["cartpole", "ballbalance", "ant"])
def test_a_step_on_warp_is_a_step_of_mujoco(env: str):
    for difference in compare(env, "warp-cpu", 50):
        assert difference.median <= MEDIAN and difference.usual <= USUAL, difference


def test_a_simulator_agrees_with_itself_up_to_the_rounding_of_the_state_it_takes_over():
    assert all(difference.worst < 1e-5 for difference in compare("quadcopter", "cpu", 5))
