"""The tasks that hand eggs over with hands that move; `test_over.py` has the one with fixed hands."""

import math

import pytest
import torch

from openeureka.tasks.rotations import rotate, rotation_distance

from .worlds import fresh, press, scored, state_with

UNDERARM, OVER2UNDERARM, ABREAST, TWO = (
    f"shadow_hand_{name}" for name in ("catch_underarm", "catch_over2underarm", "catch_abreast", "two_catch_underarm")
)
UNTURNED = [1.0, 0.0, 0.0, 0.0]
START = {UNDERARM: (0.0, -0.39, 0.555), OVER2UNDERARM: (0.0, 0.05, 1.03), ABREAST: (-0.39, -0.55, 0.545)}
GOAL = {UNDERARM: (0.0, -0.79, 0.54), OVER2UNDERARM: (0.0, -0.4, 0.55), ABREAST: (-0.39, -1.15, 0.54)}


@pytest.mark.parametrize(("env", "spread"), [(UNDERARM, 0.01), (OVER2UNDERARM, 0.0), (ABREAST, 0.0)])
def test_the_egg_starts_at_the_right_hand_in_any_orientation(env: str, spread: float) -> None:
    state = fresh(env, worlds=64).current_state()
    offset = state["object_pos"] - torch.tensor(START[env])
    assert float(offset.abs().max()) == pytest.approx(spread, abs=1e-3)
    assert torch.equal(state["goal_pos"], torch.tensor(GOAL[env]).expand(64, 3))
    assert float(state["rotation_distance"].std()) > 0.3


@pytest.mark.parametrize("env", [UNDERARM, OVER2UNDERARM, ABREAST])
@pytest.mark.parametrize(("above", "expected"), [(0.025, 1.0), (0.035, 0.0)])
def test_the_egg_is_caught_within_three_centimetres_of_the_goal(env: str, above: float, expected: float) -> None:
    simulation = fresh(env)
    x, y, z = GOAL[env]
    assert scored(simulation, state_with(simulation, {"object": [x, y, z + above, *UNTURNED]})) == [expected]


@pytest.mark.parametrize(("env", "height"), [(UNDERARM, 0.1), (OVER2UNDERARM, 0.3), (ABREAST, 0.2), (TWO, 0.2)])
def test_a_dropped_egg_ends_the_episode(env: str, height: float) -> None:
    simulation = fresh(env)
    for above, expected in ((-0.01, True), (0.01, False)):
        state = state_with(simulation, {"object": [0.0, -0.5, height + above, *UNTURNED]})
        assert simulation.task.terminated(state).tolist() == [expected]


@pytest.mark.parametrize(("env", "weight"), [(UNDERARM, 50.0), (OVER2UNDERARM, 20.0), (ABREAST, 50.0)])
def test_human_reward_falls_with_distance_and_angle(env: str, weight: float) -> None:
    simulation = fresh(env)
    x, y, z = GOAL[env]
    state = dict(state_with(simulation, {"object": [x, y, z + 0.1, *UNTURNED]}))
    state["rotation_distance"] = torch.tensor([0.5])
    # At 50 / m: exp(-0.2 * (50 * 0.1 + 0.5)) = exp(-1.1); at 20 / m: exp(-0.2 * (20 * 0.1 + 0.5)) = exp(-0.5)
    expected = {50.0: math.exp(-1.1), 20.0: math.exp(-0.5)}[weight]
    assert float(simulation.task.human_reward(state)) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("env", [OVER2UNDERARM, ABREAST])
@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize(("away", "expected"), [(0.08, False), (0.12, True)])
def test_a_hand_that_leaves_its_place_ends_the_episode(env: str, hand: str, away: float, expected: bool) -> None:
    simulation = fresh(env)
    state = state_with(simulation, {f"{hand}_base_z": [away]})  # along the forearm
    assert simulation.task.terminated(state).tolist() == [expected]


def test_hands_that_catch_underarm_may_go_anywhere() -> None:
    simulation = fresh(UNDERARM)
    state = state_with(simulation, {"left_base_z": [0.4]})
    assert simulation.task.terminated(state).tolist() == [False]


def test_the_upright_hand_has_the_egg_on_its_fingertips_and_the_other_waits_below() -> None:
    state = fresh(OVER2UNDERARM).current_state()
    lowest = state["object_pos"][0, 2] - 0.04
    assert 0.0 < float(lowest - state["fingertip_pos"][0, :, 2].max()) < 0.05
    assert float(state["fingertip_another_pos"][0, :, 2].max()) < 0.55


def test_palms_abreast_tilt_towards_each_other() -> None:
    state = fresh(ABREAST).current_state()
    out = torch.tensor([0.0, -1.0, 0.0])  # of the palm
    for side, towards in (("right", -1.0), ("left", 1.0)):
        facing = rotate(state[f"{side}_hand_rot"], out)[0].tolist()
        assert facing == pytest.approx([0.0, towards * math.sin(0.3925), math.cos(0.3925)], abs=2e-3)


def test_two_eggs_start_alike_and_swap_places() -> None:
    state = fresh(TWO, worlds=32).current_state()
    apart = state["object_another_pos"] - state["object_pos"]
    assert torch.allclose(apart, torch.tensor([0.0, -0.39, 0.0]), atol=1e-6)
    assert torch.equal(state["object_another_rot"], state["object_rot"])
    assert torch.equal(state["goal_another_rot"], state["goal_rot"])
    assert state["goal_pos"][0].tolist() == pytest.approx([0.0, -0.79, 0.54])
    assert state["goal_another_pos"][0].tolist() == pytest.approx([0.0, -0.38, 0.54])
    assert float(state["goal_another_rot"].std(dim=0).min()) > 0.1
    turn = rotation_distance(state["object_another_rot"], state["goal_another_rot"])
    assert torch.equal(state["rotation_distance_another"], turn)


def eggs(first: float, second: float) -> dict[str, list[float]]:
    """Each above its own goal [m]."""
    return {
        "object": [0.0, -0.79, 0.54 + first, *UNTURNED],
        "object_another": [0.0, -0.38, 0.54 + second, *UNTURNED],
    }


@pytest.mark.parametrize(
    ("first", "second", "expected"), [(0.05, 0.005, 1.0), (0.05, 0.015, 0.0), (0.005, 0.05, 1.0), (0.0, 0.07, 0.0)]
)
def test_two_eggs_are_caught_when_their_distances_add_up_to_less_than_six_centimetres(first, second, expected) -> None:
    simulation = fresh(TWO)
    assert scored(simulation, state_with(simulation, eggs(first, second))) == [expected]


def test_either_egg_ends_the_episode_when_dropped() -> None:
    simulation = fresh(TWO)
    assert simulation.task.terminated(state_with(simulation, eggs(0.0, 0.0))).tolist() == [False]
    assert simulation.task.terminated(state_with(simulation, eggs(0.0, -0.35))).tolist() == [True]
    assert simulation.task.terminated(state_with(simulation, eggs(-0.35, 0.0))).tolist() == [True]


def test_human_reward_of_two_eggs_is_the_sum_of_each() -> None:
    simulation = fresh(TWO)
    state = dict(state_with(simulation, eggs(0.1, 0.0)))
    state["rotation_distance"], state["rotation_distance_another"] = torch.tensor([0.5]), torch.tensor([1.0])
    # exp(-0.2 * (50 * 0.1 + 0.5)) + exp(-0.2 * 1)
    assert float(simulation.task.human_reward(state)) == pytest.approx(math.exp(-1.1) + math.exp(-0.2), rel=1e-4)


@pytest.mark.parametrize("env", [UNDERARM, TWO])
def test_eggs_stay_on_the_palms_until_they_are_thrown(env: str) -> None:
    state = press(fresh(env, worlds=4), {}, steps=60)
    for egg in ("object", "object_another"):
        if egg == "object" or env == TWO:
            assert float(state[f"{egg}_pos"][:, 2].min()) > 0.5
