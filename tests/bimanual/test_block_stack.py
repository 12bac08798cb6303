import pytest

from openeureka.suite.dexterity.common import distance, finger_distances

from .worlds import fresh, let_go, scored, state_with, with_fingers_at

STACK = "shadow_hand_block_stack"


def blocks(right: tuple[float, float], left: tuple[float, float]) -> dict[str, list[float]]:
    """Places (y, z) of the two blocks."""
    return {name: [0.0, *place, 1.0, 0.0, 0.0, 0.0] for name, place in (("object", right), ("block", left))}


def test_the_hands_start_where_the_originals_do() -> None:
    state = fresh(STACK).current_state()
    for side, fingers in (("right", 0.539), ("left", 0.540)):
        reach = finger_distances(state, side, state[f"block_{side}_handle_pos"])
        assert float(reach) == pytest.approx(fingers, abs=0.01)


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


# Places are (0, 0.625) for the right and (0, 0.675) for the left block.
@pytest.mark.parametrize(
    ("right", "left", "expected"),
    [
        ((0.0, 0.625), (0.0, 0.675), 1.0),
        ((0.06, 0.625), (-0.06, 0.67), 1.0),
        ((0.08, 0.625), (0.0, 0.675), 0.0),
        ((0.0, 0.625), (0.08, 0.675), 0.0),
        ((0.0, 0.625), (0.0, 0.71), 0.0),
        ((0.1, 0.625), (-0.1, 0.625), 0.0),
    ],
)
def test_the_blocks_are_stacked_when_both_are_near_their_places_and_the_left_one_is_level(
    right: tuple[float, float], left: tuple[float, float], expected: float
) -> None:
    simulation = fresh(STACK)
    assert scored(simulation, state_with(simulation, blocks(right, left))) == [expected]


@pytest.mark.parametrize(("offset", "expected"), [(0.14, False), (0.16, True)])
def test_the_episode_ends_when_a_hand_leaves_its_block(offset: float, expected: bool) -> None:
    simulation = fresh(STACK)
    state = simulation.current_state()
    state = with_fingers_at(state, offset, right=state["block_right_handle_pos"])
    assert simulation.task.terminated(state).tolist() == [expected]


@pytest.mark.parametrize(
    ("right", "left", "offset", "expected"),
    [
        # 1.5 - 0.25 - 0.25 + 2 (0.24 - 0.1 - 0.1)
        ((0.1, 0.625), (-0.1, 0.675), 0.05, 1.08),
        # The fingers are too far: 1.5 - 0.6 - 0.6
        ((0.1, 0.625), (-0.1, 0.675), 0.12, 0.3),
        # Stacked, 0.01 too high: 1.5 - 0.25 - 0.25 + 2 (0.24 - 0 - 0.01) + 50 (0.05 - 0.01)
        ((0.0, 0.625), (0.0, 0.685), 0.05, 3.46),
    ],
)
def test_human_reward_pays_for_gathering_then_for_height(right, left, offset: float, expected: float) -> None:
    simulation = fresh(STACK)
    state = state_with(simulation, blocks(right, left))
    state = with_fingers_at(state, offset, right=state["block_right_handle_pos"], left=state["block_left_handle_pos"])
    assert float(simulation.task.human_reward(state)) == pytest.approx(expected, abs=1e-3)
