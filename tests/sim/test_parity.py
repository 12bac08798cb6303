"""MuJoCo Warp against MuJoCo on the nine Isaac tasks and some others. `benchmarks/gpu.py` compares them on a GPU."""

import pytest

from openeureka.testing.conformance.parity import compare

pytest.importorskip("mujoco_warp", reason="pip install 'openeureka[gpu]'")

# Float32 against float64, after one control step from the same state, relative to 1 + value.
MEDIAN = 2e-5
USUAL = {
    "cartpole": 1e-5,
    "quadcopter": 1e-5,
    "franka_cabinet": 1e-5,
    "ballbalance": 1e-3,
    "ant": 1e-3,
    "allegro_hand": 1e-3,
    "humanoid": 1e-2,  # the contact wrenches of the feet are the least exact
    "anymal": 1e-2,
}


@pytest.mark.parametrize("env", USUAL)
def test_a_step_on_warp_is_a_step_of_mujoco(env: str):
    for difference in compare(env, "warp-cpu", 50):
        assert difference.median <= MEDIAN and difference.usual <= USUAL[env], difference


def test_a_shadow_hand_on_warp_is_one_of_mujoco_but_for_the_steps_in_which_two_fingers_touch():
    """Where two capsules meet end to end, MuJoCo may count one contact point twice. MuJoCo Warp counts it once."""
    for difference in compare("shadow_hand", "warp-cpu", 50):
        assert difference.median <= MEDIAN, difference
        if difference.variable in ("object_pos", "object_rot", "object_linvel", "object_angvel"):
            assert difference.usual <= 1e-2, difference
        if difference.variable == "shadow_hand_dof_pos":
            assert difference.usual <= 2e-3, difference


@pytest.mark.parametrize("env", ["shadow_hand_push_block", "shadow_hand_door_open_outward", "shadow_hand_spin"])
def test_other_suites_run_on_warp_too(env: str):
    """Five steps of tasks whose kernels compile in seconds. `benchmarks/gpu.py --part parity` compares all tasks."""
    assert all(difference.median <= MEDIAN for difference in compare(env, "warp-cpu", 5, worlds=2))


def test_a_simulator_agrees_with_itself_up_to_the_rounding_of_the_state_it_takes_over():
    assert all(difference.worst < 1e-5 for difference in compare("quadcopter", "cpu", 5))
