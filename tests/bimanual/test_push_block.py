import pytest
import torch

from openeureka.suite.dexterity.common import distance, finger_distances

from .worlds import fresh, press, scored, state_with, with_fingers_at

BLOCKS = "shadow_hand_push_block"


def blocks(right_x: float, left_x: float, z: float = 0.625) -> dict[str, list[float]]:
    return {
        name: [x, y, z, 1.0, 0.0, 0.0, 0.0] for name, x, y in (("object", right_x, 0.2), ("block_left", left_x, -0.2))
    }


def test_the_hands_start_where_the_originals_do() -> None:
    state = state_with(fresh(BLOCKS), blocks(0.0, 0.0, z=0.6))  # the original starts the blocks inside the table
    for side in ("right", "left"):
        block = state[f"block_{side}_handle_pos"]
        assert float(distance(state[f"{side}_hand_pos"], block)) == pytest.approx(0.262, abs=0.003)
        assert float(finger_distances(state, side, block)) == pytest.approx(1.178, abs=0.01)


def test_the_blocks_start_at_rest_each_in_line_with_its_goal() -> None:
    simulation = fresh(BLOCKS)
    start = simulation.current_state()
    for side in ("right", "left"):
        ahead = start[f"{side}_goal_pos"] - start[f"block_{side}_handle_pos"]
        assert ahead[0].tolist() == pytest.approx([-0.2, 0.0, 0.0])
    state = press(simulation, {}, steps=10)
    assert float(distance(start["object_pos"], state["object_pos"])) < 1e-3


# Goals are at x = -0.2; a block has arrived 0.1 m from its own.
@pytest.mark.parametrize(
    ("right_x", "left_x", "expected"),
    [(-0.11, -0.11, 1.0), (-0.09, -0.11, 0.5), (-0.11, -0.09, 0.0), (0.0, 0.0, 0.0)],
)
def test_arrived_blocks_count_half_each_if_the_left_one_is_there(
    right_x: float, left_x: float, expected: float
) -> None:
    simulation = fresh(BLOCKS)
    assert scored(simulation, state_with(simulation, blocks(right_x, left_x))) == [expected]


def test_a_right_block_that_comes_later_does_not_count() -> None:
    simulation = fresh(BLOCKS)
    assert scored(simulation, state_with(simulation, blocks(0.0, -0.2))) == [0.5]
    assert scored(simulation, state_with(simulation, blocks(-0.2, -0.2))) == [0.5]


def test_one_world_starts_again_without_the_others() -> None:
    simulation = fresh(BLOCKS, worlds=2)
    state_with(simulation, blocks(-0.1, -0.1))
    simulation.task.reset(torch.tensor([1]))
    simulation.sim.forward(torch.arange(2))
    assert simulation.current_state()["object_pos"][:, 0].tolist() == pytest.approx([-0.1, 0.0])


@pytest.mark.parametrize(("offset", "expected"), [(0.23, False), (0.25, True)])
def test_the_episode_ends_when_a_hand_leaves_its_block(offset: float, expected: bool) -> None:
    simulation = fresh(BLOCKS)
    state = simulation.current_state()
    state = with_fingers_at(state, offset, left=state["block_left_handle_pos"])  # summed over five: 1.15 and 1.25
    assert simulation.task.terminated(state).tolist() == [expected]


def test_human_reward_falls_with_every_distance() -> None:
    simulation = fresh(BLOCKS)
    state = state_with(simulation, blocks(-0.1, -0.15))
    state = with_fingers_at(state, 0.04, right=state["block_right_handle_pos"], left=state["block_left_handle_pos"])
    # (1.2 - 0.2) twice, then 5 - 5 * 0.1 - 5 * 0.05
    assert float(simulation.task.human_reward(state)) == pytest.approx(6.25, abs=1e-3)
