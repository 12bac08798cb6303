"""What doors do by themselves, and when they are pushed."""

import pytest
import torch

from openeureka.suite.angles import scaled

from .worlds import fresh, press

OPEN_IN, OPEN_OUT, CLOSE_IN, CLOSE_OUT = (
    f"shadow_hand_door_{name}" for name in ("open_inward", "open_outward", "close_inward", "close_outward")
)


@pytest.mark.parametrize(("env", "gap"), [(OPEN_IN, 0.067), (OPEN_OUT, 0.067), (CLOSE_IN, 0.926), (CLOSE_OUT, 0.766)])
def test_the_doors_stay_as_they_are_by_themselves(env: str, gap: float) -> None:
    simulation = fresh(env)
    for state in (simulation.current_state(), press(simulation, {}, steps=60)):
        handles = state["door_right_handle_pos"] - state["door_left_handle_pos"]
        assert float(handles[0, 1]) == pytest.approx(gap, abs=0.002)


def test_hands_that_go_straight_ahead_push_the_doors_open() -> None:
    simulation = fresh(OPEN_OUT)
    lower, upper = torch.from_numpy(simulation.sim.model.actuator_ctrlrange.T)
    straight = scaled(torch.zeros(40), lower, upper).clamp(-1.0, 1.0).tolist()  # fingers and wrists
    right = [-1.0, -0.35, 0.0, 0.0, 0.0, 0.0, *straight[:20]]  # ahead, and a little inwards
    left = [-1.0, 0.35, 0.0, 0.0, 0.0, 0.0, *straight[20:]]
    steps = [simulation.step(torch.tensor([right + left])) for _ in range(180)]
    assert not any(bool(step.done) for step in steps)
    assert [float(steps[at].score.value) for at in (0, 100, 179)] == [0.0, 0.0, 1.0]
