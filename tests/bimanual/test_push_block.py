import pytest
import torch

from openeureka.suite.dexterity.common import distance
from openeureka.tasks.registry import get

from .worlds import fresh, press, scored, state_with

BLOCKS = "shadow_hand_push_block"


def blocks(right_x: float, left_x: float, z: float = 0.625) -> dict[str, list[float]]:
    return {
        name: [x, y, z, 1.0, 0.0, 0.0, 0.0] for name, x, y in (("object", right_x, 0.2), ("block_left", left_x, -0.2))
    }


def test_the_blocks_start_at_rest_each_in_line_with_its_goal() -> None:
    simulation = fresh(BLOCKS)
    start = simulation.current_state()
    for side in ("right", "left"):
        ahead = start[f"{side}_goal_pos"] - start[f"block_{side}_handle_pos"]
        assert ahead[0].tolist() == pytest.approx([-0.2, 0.0, 0.0])
    assert start["goal_states"][0, 2] > 10
    assert simulation.task.spec["goal_states"].meaning.startswith("unused, far above the table: ")
    state = press(simulation, {}, steps=10)
    assert float(distance(start["object_pos"], state["object_pos"])) < 1e-3


def test_the_score_is_what_the_model_is_told() -> None:
    for (right_x, left_x), score in {(-0.2, 0.0): 0.0, (0.0, -0.2): 0.5, (-0.2, -0.2): 1.0}.items():
        simulation = fresh(BLOCKS)
        assert scored(simulation, state_with(simulation, blocks(right_x, left_x))) == [score]
    assert get(BLOCKS).score_unit == "1 for both blocks, 0.5 if the left comes first"


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
