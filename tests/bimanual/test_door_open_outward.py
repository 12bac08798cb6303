import pytest
import torch

from openeureka.suite.angles import scaled
from openeureka.suite.dexterity.common import distance, finger_distances

from .worlds import fresh, press, scored, state_with

DOOR = "shadow_hand_door_open_outward"


def leaves(angle: float) -> dict[str, list[float]]:
    return {"door_right_hinge": [angle], "door_left_hinge": [angle]}


def test_the_hands_start_where_the_originals_do() -> None:
    state = fresh(DOOR).current_state()
    for side, palm, fingers in (("right", 0.229, 1.011), ("left", 0.231, 1.094)):  # forward kinematics of the originals
        handle = state[f"door_{side}_handle_pos"]
        assert float(distance(state[f"{side}_hand_pos"], handle)) == pytest.approx(palm, abs=0.003)
        assert float(finger_distances(state, side, handle)) == pytest.approx(fingers, abs=0.01)


@pytest.mark.parametrize(("angle", "gap", "expected"), [(0.0, 0.067, 0.0), (1.20, 0.49, 0.0), (1.24, 0.51, 1.0)])
def test_doors_are_open_when_their_handles_are_half_a_metre_apart(angle: float, gap: float, expected: float) -> None:
    simulation = fresh(DOOR)
    state = state_with(simulation, leaves(angle))
    measured = float((state["door_right_handle_pos"] - state["door_left_handle_pos"])[0, 1].abs())
    assert measured == pytest.approx(gap, abs=0.01)
    assert scored(simulation, state) == [expected]


def test_the_episode_ends_when_a_hand_leaves_its_handle() -> None:
    simulation = fresh(DOOR, worlds=2)
    state = state_with(simulation, leaves(0.0))
    assert simulation.task.terminated(state).tolist() == [False, False]
    state = state_with(simulation, {"left_base_z": [-0.5]})  # along the forearm
    assert simulation.task.terminated(state).tolist() == [True, True]


def test_human_reward_pays_for_opening_only_when_both_hands_are_at_the_handles() -> None:
    simulation = fresh(DOOR)
    state = dict(state_with(simulation, leaves(0.0)))
    away = 2.0 - 1.011 - 1.094
    assert float(simulation.task.human_reward(state)) == pytest.approx(away, abs=0.02)
    for side in ("right", "left"):
        for finger in ("ff", "mf", "rf", "lf", "th"):
            state[f"{side}_hand_{finger}_pos"] = state[f"door_{side}_handle_pos"]
    # At the handles: 2 - 0 - 0 + 2 * 0.067
    assert float(simulation.task.human_reward(state)) == pytest.approx(2.134, abs=0.005)


def test_the_doors_stay_shut_by_themselves() -> None:
    simulation = fresh(DOOR)
    state = press(simulation, {}, steps=60)
    assert float((state["door_right_handle_pos"] - state["door_left_handle_pos"])[0, 1]) == pytest.approx(
        0.067, abs=0.005
    )


def test_hands_that_go_straight_ahead_push_the_doors_open() -> None:
    simulation = fresh(DOOR)
    lower, upper = torch.from_numpy(simulation.sim.model.actuator_ctrlrange.T)
    straight = scaled(torch.zeros(40), lower, upper).clamp(-1.0, 1.0).tolist()  # fingers and wrists
    right = [-1.0, -0.35, 0.0, 0.0, 0.0, 0.0, *straight[:20]]  # ahead, and a little inwards
    left = [-1.0, 0.35, 0.0, 0.0, 0.0, 0.0, *straight[20:]]
    steps = [simulation.step(torch.tensor([right + left])) for _ in range(180)]
    assert not any(bool(step.done) for step in steps)
    assert [float(steps[at].score.value) for at in (0, 100, 179)] == [0.0, 0.0, 1.0]
