import mujoco
import numpy as np
import pytest
import torch

from openeureka.llm import grammar
from openeureka.llm.random import RandomModel
from openeureka.suite.dexterity.common import distance, finger_distances
from openeureka.tasks.registry import get
from openeureka.tasks.rotations import rotation_distance
from openeureka.types import Prompt

from .worlds import fresh, judged, press, scored, state_with

CUP, DOOR, OVER = "shadow_hand_swing_cup", "shadow_hand_door_open_outward", "shadow_hand_over"


def test_two_compilations_of_a_model_are_equal() -> None:
    """The other tests compile each model only once, so they would not notice a difference."""
    saved = []
    for _ in range(2):
        _, model = get(OVER).compiled()
        saved.append(np.empty(mujoco.mj_sizeModel(model), np.uint8))
        mujoco.mj_saveModel(model, None, saved[-1])
    assert np.array_equal(*saved)


def test_both_hands_are_right_hands_of_24_joints() -> None:
    state = fresh(CUP).current_state()
    lower, upper = state["dof_lower_limits"], state["dof_upper_limits"]
    assert torch.equal(lower[:24], lower[24:]) and torch.equal(upper[:24], upper[24:])
    assert (float(lower[0]), float(upper[0])) == pytest.approx((-0.489, 0.140))  # WRJ1
    assert (float(lower[23]), float(upper[23])) == pytest.approx((-1.571, 0.0))  # THJ0


@pytest.mark.parametrize(("first_drive", "wrist"), [(6, 0), (32, 24)])
def test_drives_pull_a_hands_joints_to_their_targets(first_drive: int, wrist: int) -> None:
    simulation = fresh(CUP)
    state = press(simulation, {first_drive: 1.0, first_drive + 1: -1.0}, steps=60)
    assert float(state["dof_pos"][0, wrist]) == pytest.approx(0.140, abs=0.01)
    assert float(state["dof_pos"][0, wrist + 1]) == pytest.approx(-0.698, abs=0.01)


@pytest.mark.parametrize(("column", "base"), [(2, "right_base"), (28, "left_base")])
def test_a_push_moves_the_base_without_turning_it(column: int, base: str) -> None:
    simulation = fresh(DOOR)
    settled = press(simulation, {}, steps=30)
    before = press(simulation, {column: 1.0}, steps=6)
    after = press(simulation, {column: 1.0}, steps=15)
    # A force of 0.5 * 1e5 / 60 / 6 = 138.9 N against 501 N s/m gives 0.277 m/s, here for a quarter of a second.
    moved = after[f"{base}_pos"][0] - before[f"{base}_pos"][0]
    assert moved.tolist() == pytest.approx([0.0, 0.0, 0.0693], abs=0.003)
    assert float(rotation_distance(settled[f"{base}_rot"], after[f"{base}_rot"])) < 0.01


def test_a_torque_turns_the_base() -> None:
    simulation = fresh(DOOR)
    before = press(simulation, {}, steps=30)
    after = press(simulation, {5: 1.0}, steps=30)
    # A torque of 0.5 * 1e3 / 60 / 6 = 1.39 N m against 2.65 N m s gives 0.52 rad/s, here for half a second.
    turned = float(rotation_distance(before["right_base_rot"], after["right_base_rot"]))
    assert turned == pytest.approx(0.26, abs=0.02)
    assert torch.allclose(before["left_base_rot"], after["left_base_rot"], atol=1e-3)


def test_fixed_bases_have_neither_joints_nor_actions() -> None:
    simulation = fresh(OVER)
    assert simulation.sim.model.nv == 24 + 24 + 6  # the joints of both hands, and the egg
    assert simulation.task.num_actions == 20 + 20


def test_success_stands_until_the_episode_ends_and_pays_on_its_last_step() -> None:
    simulation = fresh(DOOR, worlds=2)
    task = simulation.task
    closed = simulation.current_state()
    assert scored(simulation, closed) == [0.0, 0.0]
    opened = state_with(simulation, {"door_right_hinge": [1.4], "door_left_hinge": [1.4]})
    assert scored(simulation, opened) == [1.0, 1.0]
    assert scored(simulation, closed) == [1.0, 1.0]
    last = judged(simulation, closed)
    task.reset(torch.tensor([1]))
    assert task.sparse_reward(last).tolist() == [1.0, 1.0]
    assert scored(simulation, closed) == [1.0, 0.0]
    assert task.sparse_reward(judged(simulation, closed)).tolist() == [1.0, 0.0]


HINGES = ("door_right_hinge", "door_left_hinge")


@pytest.mark.parametrize(
    ("env", "joints", "angles", "gaps"),
    [
        ("shadow_hand_door_open_inward", HINGES, (0.0, 0.8, 1.57), (0.07, 0.36, 0.93)),
        (DOOR, HINGES, (0.0, 0.8, 1.57), (0.07, 0.25, 0.77)),
        ("shadow_hand_pen", ("pen_cap_slide",), (0.0, 0.2, 0.4), (0.17, 0.37, 0.57)),
        ("shadow_hand_scissors", ("scissors_hinge",), (-0.59, -0.3, 0.4), (0.07, 0.13, 0.28)),
    ],
)
def test_the_small_model_can_pay_for_handles_that_come_apart(env, joints, angles, gaps) -> None:
    simulation = fresh(env)
    states = [state_with(simulation, {joint: [angle] for joint in joints}) for angle in angles]
    assert [float(state["handles_apart"]) for state in states] == pytest.approx(gaps, abs=0.005)
    spec = simulation.task.spec
    prompt = Prompt(messages=(), grammar=grammar.grammar(spec), prefill=grammar.prefill(spec))
    replies = RandomModel().sample(prompt, n=40, seed=0)
    assert any("x = handles_apart\n    reward = reward + " in reply.text for reply in replies)


@pytest.mark.parametrize("env", [DOOR, "shadow_hand_switch"])
def test_things_that_never_move_are_not_offered_to_the_small_model(env: str) -> None:
    simulation = fresh(env)
    offered = {variable.name for variable in grammar.offered(simulation.task.spec)}
    assert not offered & {"object_pos", "object_linvel", "object_angvel"}
    place = simulation.current_state()["object_pos"][0].tolist()
    said = simulation.task.spec["object_pos"].meaning
    assert f"fixed at ({', '.join(f'{x:.2g}' for x in place)})" in said


def test_f_changes_nothing_and_may_be_asked_again() -> None:
    simulation = fresh(DOOR, worlds=2)
    opened = judged(simulation, state_with(simulation, {"door_right_hinge": [1.4], "door_left_hinge": [1.4]}))
    before = {name: value.clone() for name, value in simulation.task.tensors().items()}
    scores = [simulation.task.fitness(opened, torch.ones(2)).value for _ in range(2)]
    assert torch.equal(*scores)
    assert all(torch.equal(before[name], value) for name, value in simulation.task.tensors().items())


def test_only_episodes_that_end_count() -> None:
    simulation = fresh(DOOR, worlds=2)
    state = judged(simulation, simulation.current_state())
    score = simulation.task.fitness(state, torch.tensor([True, False]))
    assert score.weight.tolist() == [1.0, 0.0]


def test_finger_distances_are_summed_over_the_five_fingers() -> None:
    fingers = {f"right_hand_{finger}_pos": torch.tensor([[0.0, 3.0, 0.0]]) for finger in ("ff", "mf", "rf", "lf")}
    state = {**fingers, "right_hand_th_pos": torch.tensor([[0.0, 0.0, 2.0]])}
    assert float(finger_distances(state, "right", torch.tensor([[4.0, 0.0, 2.0]]))) == pytest.approx(
        4 * 29**0.5 + 4.0  # (4, 3, 2) is sqrt(29) long
    )


def test_fingertips_are_two_centimetres_beyond_the_last_joints() -> None:
    state = fresh(CUP).current_state()
    for side, joints in (("right", "fingertip_pos"), ("left", "fingertip_another_pos")):
        ends = torch.stack([state[f"{side}_hand_{finger}_pos"] for finger in ("ff", "mf", "rf", "lf", "th")], dim=1)
        assert torch.allclose(distance(ends, state[joints]), torch.tensor(0.02), atol=1e-5)


def test_hands_start_with_equal_noise_inside_their_joint_ranges() -> None:
    state = fresh(OVER, worlds=16).current_state()
    angles = state["dof_pos"]
    assert torch.equal(angles[:, :24], angles[:, 24:])
    assert bool((angles >= state["dof_lower_limits"] - 1e-6).all())
    assert bool((angles <= state["dof_upper_limits"] + 1e-6).all())
    assert float(angles.std(dim=0).min()) > 0.01


def test_a_moving_bases_turn_is_observed_from_the_start() -> None:
    simulation = fresh(DOOR)
    base = slice(24 * 3 + 65 + 30 + 3, 24 * 3 + 65 + 30 + 6)  # after joints, fingertips, their wrenches, the palm
    assert simulation.current_state()["obs_buf"][0, base].tolist() == pytest.approx([0.0, 0.0, 0.0], abs=1e-5)
    observed = press(simulation, {5: 1.0}, steps=15)["obs_buf"][0, base]
    # 0.52 rad/s about z for a quarter of a second; twice the sine of half the angle is about the angle.
    assert observed.tolist() == pytest.approx([0.0, 0.0, 0.13], abs=0.02)
