import pytest

from openeureka.llm import grammar
from openeureka.llm.gbnf import parse
from openeureka.suite.dexterity.common import distance

from .worlds import fresh, let_go, state_with

STACK = "shadow_hand_block_stack"


def blocks(right: tuple[float, float], left: tuple[float, float]) -> dict[str, list[float]]:
    """Places (y, z) of the two blocks."""
    return {name: [0.0, *place, 1.0, 0.0, 0.0, 0.0] for name, place in (("object", right), ("block", left))}


def test_the_goal_is_told_from_where_the_lower_block_belongs() -> None:
    simulation = fresh(STACK)
    lower = simulation.task.ghosts()["object"][0, :3]
    moved = simulation.current_state()["goal_pos"][0] - lower
    assert moved.tolist() == pytest.approx([0.0, 0.1, 0.0], abs=1e-6)
    assert simulation.task.spec["goal_pos"].meaning.startswith("+0.1 m in y from where the lower, right block belongs")
    cubes = [simulation.task.scene.things[name].thing for name in ("object", "block")]
    assert [cube.edge for cube in cubes] == [0.05, 0.05]
    assert all("a cube of 5 cm" in simulation.task.spec[name].meaning for name in simulation.task.handles)


def test_the_small_model_can_pay_for_blocks_that_come_to_their_places() -> None:
    simulation = fresh(STACK)
    gaps = [sequence[0].value for sequence in parse(grammar.grammar(simulation.task.spec))["gap"]]
    assert {"object_pos - right_goal_pos", "left_goal_pos - block_pos"} < set(gaps)
    assert "goal_pos" not in {name for gap in gaps for name in gap.split(" - ")}  # beside the stack
    stacked = state_with(simulation, blocks((0.0, 0.625), (0.0, 0.675)))
    assert float(distance(stacked["object_pos"], stacked["right_goal_pos"])) < 1e-6
    assert float(distance(stacked["block_pos"], stacked["left_goal_pos"])) < 1e-6


def test_a_stack_stands() -> None:
    simulation = fresh(STACK)
    start = state_with(simulation, blocks((0.0, 0.625), (0.0, 0.675)))
    state = let_go(simulation, steps=20)
    assert float(distance(start["block_pos"], state["block_pos"])) < 2e-3
