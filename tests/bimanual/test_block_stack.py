import pytest

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


def test_a_stack_stands() -> None:
    simulation = fresh(STACK)
    start = state_with(simulation, blocks((0.0, 0.625), (0.0, 0.675)))
    state = let_go(simulation, steps=20)
    assert float(distance(start["block_pos"], state["block_pos"])) < 2e-3
