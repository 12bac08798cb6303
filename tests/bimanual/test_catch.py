"""The tasks in which hands that can move pass eggs."""

import math

import pytest
import torch

from openeureka.suite.dexterity.common import TwoHands
from openeureka.tasks.registry import get
from openeureka.tasks.rotations import rotate, rotation_distance

from .worlds import fresh, press, state_with

UNDERARM, OVER2UNDERARM, ABREAST, TWO = (
    f"shadow_hand_{name}" for name in ("catch_underarm", "catch_over2underarm", "catch_abreast", "two_catch_underarm")
)


@pytest.mark.parametrize("env", ["shadow_hand_over", UNDERARM, OVER2UNDERARM, ABREAST, TWO])
def test_a_goal_is_a_place_and_the_model_is_told_that_its_orientation_does_not_matter(env: str) -> None:
    spec = get(env).spec
    said = {v.name for v in spec.variables if v.meaning.endswith("orientation is random and does not matter")}
    names = {"goal_pose", "goal_rot", "rotation_distance"}
    assert said == names | ({"goal_another_pose", "goal_another_rot", "rotation_distance_another"} & set(spec.names))
    assert {spec[name].use for name in said} == {"raw"} and spec["goal_pos"].use == "point"
    simulation = fresh(env)
    assert isinstance(simulation.task, TwoHands)
    state = simulation.current_state()
    placed = {name.replace("goal", "object"): state[name] for name in ("goal_pos", "goal_another_pos") if name in state}
    assert float(state["rotation_distance"]) > 0.1 and simulation.task.success({**state, **placed}).all()


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
    out = torch.tensor([0.0, -1.0, 0.0])  # the palm's normal, in the hand's frame
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


@pytest.mark.parametrize("env", [UNDERARM, TWO])
def test_eggs_stay_on_the_palms_until_they_are_thrown(env: str) -> None:
    state = press(fresh(env, worlds=4), {}, steps=60)
    for egg in ("object", "object_another"):
        if egg == "object" or env == TWO:
            assert float(state[f"{egg}_pos"][:, 2].min()) > 0.5
