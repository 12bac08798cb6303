"""The three doors besides `test_door_open_outward.py`."""

import pytest
import torch

from openeureka.suite.dexterity.common import distance, finger_distances

from .worlds import fresh, press, scored, state_with

OPEN_IN, CLOSE_IN, CLOSE_OUT = (f"shadow_hand_door_{name}" for name in ("open_inward", "close_inward", "close_outward"))
FINGERS = ("ff", "mf", "rf", "lf", "th")


def leaves(angle: float) -> dict[str, list[float]]:
    return {"door_right_hinge": [angle], "door_left_hinge": [angle]}


@pytest.mark.parametrize(
    ("env", "side", "palm", "fingers"),
    [  # forward kinematics of the originals
        (OPEN_IN, "right", 0.234, 1.053),
        (OPEN_IN, "left", 0.239, 1.167),
        (CLOSE_IN, "right", 0.177, 0.639),
        (CLOSE_IN, "left", 0.180, 0.773),
        (CLOSE_OUT, "right", 0.616, 2.648),
        (CLOSE_OUT, "left", 0.612, 2.652),
    ],
)
def test_the_hands_start_where_the_originals_do(env: str, side: str, palm: float, fingers: float) -> None:
    state = fresh(env).current_state()
    handle = state[f"door_{side}_handle_pos"]
    assert float(distance(state[f"{side}_hand_pos"], handle)) == pytest.approx(palm, abs=0.002)
    assert float(finger_distances(state, side, handle)) == pytest.approx(fingers, abs=0.005)


@pytest.mark.parametrize(
    ("env", "angle", "expected"),
    [
        (OPEN_IN, 0.0, 0.0),
        (OPEN_IN, 1.00, 0.0),
        (OPEN_IN, 1.04, 1.0),
        (CLOSE_IN, 1.57, 0.0),
        (CLOSE_IN, 1.04, 0.0),
        (CLOSE_IN, 1.00, 1.0),
        (CLOSE_OUT, 1.57, 0.0),
        (CLOSE_OUT, 1.24, 0.0),
        (CLOSE_OUT, 1.20, 1.0),
    ],
)
def test_doors_are_open_when_their_handles_are_half_a_metre_apart(env: str, angle: float, expected: float) -> None:
    simulation = fresh(env)
    assert scored(simulation, state_with(simulation, leaves(angle))) == [expected]


@pytest.mark.parametrize(("env", "gap"), [(OPEN_IN, 0.067), (CLOSE_IN, 0.926), (CLOSE_OUT, 0.766)])
def test_the_doors_stay_as_they_are_by_themselves(env: str, gap: float) -> None:
    simulation = fresh(env)
    for state in (simulation.current_state(), press(simulation, {}, steps=60)):
        handles = state["door_right_handle_pos"] - state["door_left_handle_pos"]
        assert float(handles[0, 1]) == pytest.approx(gap, abs=0.002)


@pytest.mark.parametrize(
    ("env", "away", "bonus"),
    [
        (OPEN_IN, 2.0 - 1.053 - 1.167, 2.0 * 0.067),
        (CLOSE_IN, 2.0 - 0.639 - 0.773, 1.0 - 2.0 * 0.926),
        (CLOSE_OUT, 6.0 - 2.648 - 2.652, 1.0 - 2.0 * 0.766),
    ],
)
def test_human_reward_pays_for_the_gap_only_when_both_hands_are_at_the_handles(env, away, bonus) -> None:
    simulation = fresh(env)
    state = dict(simulation.current_state())
    assert float(simulation.task.human_reward(state)) == pytest.approx(away, abs=0.01)
    state |= {
        f"{side}_hand_{finger}_pos": state[f"door_{side}_handle_pos"]
        for side in ("right", "left")
        for finger in FINGERS
    }
    constant = 6.0 if env == CLOSE_OUT else 2.0
    assert float(simulation.task.human_reward(state)) == pytest.approx(constant + bonus, abs=0.005)


@pytest.mark.parametrize(("env", "reach"), [(OPEN_IN, 1.5), (CLOSE_IN, 1.5), (CLOSE_OUT, 3.0)])
@pytest.mark.parametrize("side", ["right", "left"])
def test_the_episode_ends_when_a_hand_leaves_its_handle(env: str, reach: float, side: str) -> None:
    simulation = fresh(env)
    state = dict(simulation.current_state())
    assert simulation.task.terminated(state).tolist() == [False]
    for away, expected in ((reach - 0.01, False), (reach + 0.01, True)):
        point = state[f"door_{side}_handle_pos"] + torch.tensor([away / 5, 0.0, 0.0])
        state |= {f"{side}_hand_{finger}_pos": point for finger in FINGERS}
        assert simulation.task.terminated(state).tolist() == [expected]
