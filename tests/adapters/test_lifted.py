"""Lifted environments against Gymnasium itself, 200 steps of each from the same states."""

import gymnasium
import numpy as np
import pytest
import torch

from openeureka.adapters.gym.families import FAMILIES
from openeureka.errors import TaskError
from openeureka.tasks import registry
from openeureka.tasks.ranges import ranges
from openeureka.testing.conformance.task import TaskConformance

STEPS = 200
EXACT = {"Hopper", "Walker2d", "HalfCheetah", "Swimmer", "Pusher", "InvertedPendulum", "InvertedDoublePendulum"}
SPEED = {"Ant": 0.045, "Humanoid": 0.002}
"""Tolerance of the speed [m/s] by environment: Gymnasium computes it from positions at the last stage of a Runge-Kutta
step, not at the end of the step."""


class TestHopper(TaskConformance):
    env = "gym:Hopper-v5"
    random_worlds, start_overlap = 8, 1e-2


class TestPusher(TaskConformance):
    env = "gym:Pusher-v5"
    random_worlds, start_overlap = 8, 1e-2


def compared(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Absolute differences of observations (T, O) and rewards (T,). Every step of both begins in Gymnasium's state."""
    ours = registry.make(f"gym:{name}-v5", worlds=1, threads=1)
    ours.reset()
    task = ours.task
    theirs = gymnasium.make(f"{name}-v5").unwrapped
    theirs.reset(seed=0)
    random, seen, paid = np.random.default_rng(0), [], []
    for number in range(STEPS):
        state = [np.float32(part).astype(np.float64) for part in (theirs.data.qpos, theirs.data.qvel)]
        theirs.set_state(*state)
        task.qpos[0], task.qvel[0] = (torch.from_numpy(part).float() for part in state)
        ours.sim.forward(torch.tensor([0]))
        task.progress[:] = 1  # not the start of an episode
        action = random.uniform(-1.0, 1.0, task.num_actions).astype(np.float32)
        space = theirs.action_space
        taken = (space.high + space.low) / 2 + (space.high - space.low) / 2 * action
        observation, reward, terminated, _, info = theirs.step(taken)
        step = ours.step(torch.from_numpy(action)[None])
        assert bool(step.terminated[0]) == terminated, number
        for key in ("x_velocity", "x_position", "z_distance_from_origin"):
            if key in info and not terminated:
                near = SPEED.get(name, 2e-5) if key == "x_velocity" else 2e-5
                assert float(step.state[key][0]) == pytest.approx(info[key], abs=near)
        seen.append(np.abs(step.final_observation[0].numpy() - observation))
        paid.append(abs(float(task.paid[0]) - reward))
        if terminated:
            theirs.reset(seed=number)
    return np.array(seen), np.array(paid)


@pytest.mark.parametrize("name", sorted(EXACT))
def test_observations_and_rewards_are_those_of_gymnasium(name: str):
    seen, paid = compared(name)
    assert seen.max() < 5e-6 and paid.max() < 2e-4


def test_a_fingertip_is_where_a_runge_kutta_step_comes_to():
    # Gymnasium reads its position at the last stage of the Runge-Kutta step, up to 3 mm away.
    seen, paid = compared("Reacher")
    assert seen[:, :8].max() < 5e-6 and seen.max() < 3e-3 and paid.max() < 3e-3


@pytest.mark.parametrize("name, state, median, most", [("Ant", 27, 1e-3, 0.045), ("Humanoid", 45, 1e-4, 0.18)])
def test_contacts_and_speeds_are_those_of_the_state_that_a_step_comes_to(
    name: str, state: int, median: float, most: float
):
    # Gymnasium reads contact forces at the last stage of a Runge-Kutta step. They differ where a contact has just
    # begun. The guide quotes these numbers.
    seen, paid = compared(name)
    assert seen[:, :state].max() < 5e-6
    assert (seen[:, state:] > 0.01).mean() < 0.04 and np.median(paid) < median and paid.max() < most


def test_pusher_goes_on_from_what_gymnasium_saw_before():
    first, second = (registry.make("gym:Pusher-v5", worlds=3) for _ in range(2))
    for simulation in (first, second):
        simulation.reset(stagger=True)
    for _ in range(4):
        first.step(torch.ones(3, 7))
    second.load_state_dict(first.state_dict())
    steps = [simulation.step(torch.zeros(3, 7)) for simulation in (first, second)]
    assert torch.equal(*(step.state["previous_obs_buf"] for step in steps))
    assert torch.equal(*(step.final_observation for step in steps))


def test_a_world_that_breaks_down_before_the_last_substep_of_pusher_is_bad(monkeypatch: pytest.MonkeyPatch):
    simulation = registry.make("gym:Pusher-v5", worlds=3)
    simulation.reset()
    step = simulation.sim.step

    def breaks(substeps: int) -> None:
        step(substeps)
        simulation.sim.bad[1] = substeps > 1

    monkeypatch.setattr(simulation.sim, "step", breaks)
    assert simulation.step(torch.zeros(3, 7)).bad.tolist() == [False, True, False]


def test_effort_is_that_of_the_action_asked_for():
    # Hopper acts every 0.008 s, so a delay of 80 ms is 10 steps without any control.
    simulation = registry.make("gym:Hopper-v5", worlds=1, ranges=[ranges({"delay": (0.08, 0.08)})])
    simulation.reset()
    simulation.step(torch.full((1, 3), 0.5))
    assert simulation.task.effort().tolist() == [0.75]  # 3 * 0.5^2, controls reach from -1 to 1
    assert float(simulation.task.ctrl.abs().max()) == 0.0


def test_every_family_has_the_observation_of_its_environment():
    for name in FAMILIES:
        task = registry.get(f"gym:{name.removesuffix('Env')}-v5")
        simulation = registry.make(task.env, worlds=2)
        assert not task.steps_itself and simulation.reset().shape == (2, task.num_observations)


def test_starts_are_drawn_as_the_original_draws_them():
    pusher, reacher = (registry.make(f"gym:{name}-v5", worlds=512) for name in ("Pusher", "Reacher"))
    pusher.reset()
    thing = pusher.task.qpos[:, 7:9]
    assert float(thing.norm(dim=1).min()) > 0.17
    assert -0.3 <= float(thing[:, 0].min()) < -0.29 and -0.01 < float(thing[:, 0].max()) <= 0.0
    reacher.reset()
    target = reacher.task.qpos[:, 2:].norm(dim=1)
    assert float(target.max()) <= 0.2
    assert float(target.square().mean()) == pytest.approx(0.02, abs=0.002)  # r^2 / 2 for a disc of radius r


def test_one_substep_is_a_control_step_too():
    simulation = registry.make("gym:Pusher-v5+frame_skip=1", worlds=2)
    simulation.reset()
    original = gymnasium.make("Pusher-v5", frame_skip=1).unwrapped
    assert simulation.task.substeps == original.frame_skip == 1
    before = simulation.task.qpos.clone()
    assert not simulation.step(torch.ones(2, simulation.task.num_actions)).bad.any()
    assert (simulation.task.qpos != before).any()


def test_a_model_that_no_gpu_solves_says_so():
    with pytest.raises(TaskError, match="PGS solver, which runs only on the CPU"):
        registry.get("gym:Humanoid-v5").simulate(1, "cuda", 1)


def test_the_constructor_decides_and_the_other_prefix_leaves_it_as_it_is():
    task = registry.get("gym:Hopper-v5+healthy_reward=3.0+exclude_current_positions_from_observation=false")
    assert task.constants["healthy_reward"] == 3.0 and task.num_observations == 12 and task.skipped == 0
    assert registry.get("gym-asis:Hopper-v5").steps_itself


@pytest.mark.parametrize("spelled", ["false", "False"])
def test_a_switch_of_the_constructor_may_be_spelled_as_json_or_python_has_it(spelled: str):
    simulation = registry.make(f"gym:Hopper-v5+terminate_when_unhealthy={spelled}", worlds=4)
    simulation.reset()
    ends = [simulation.step(torch.ones(4, 3)).terminated.any() for _ in range(60)]
    assert not any(ends)


@pytest.mark.parametrize("spelled", ["(0.8, 2)", "[0.8, 2]"])
def test_a_range_of_the_constructor_may_be_spelled_as_python_or_json_has_it(spelled: str):
    assert registry.get(f"gym:Hopper-v5+healthy_z_range={spelled}").constants["healthy_z_range"] == [0.8, 2]


@pytest.mark.parametrize("body, lifted", [("4", False), ("front_left_leg", False), ("1", True), ("torso", True)])
def test_an_ant_is_lifted_only_where_its_speed_is_that_of_its_torso(body: str, lifted: bool):
    assert registry.get(f"gym:Ant-v5+main_body={body}").steps_itself is not lifted


class Paid(gymnasium.RewardWrapper):
    def reward(self, reward):
        return -1000.0


gymnasium.register("Openeureka/Wrapped-v0", entry_point=lambda **given: Paid(gymnasium.make("Hopper-v5", **given)))
gymnasium.register("Openeureka/Same-v0", entry_point=lambda **given: gymnasium.make("Hopper-v5", **given))


def test_what_wraps_a_lifted_environment_pays_as_it_says():
    simulation = registry.make("gym:Openeureka/Wrapped-v0", worlds=2)
    simulation.reset()
    assert simulation.task.human_reward(simulation.step(torch.ones(2, 3)).state).tolist() == [-1000.0] * 2
    assert not registry.get("gym:Openeureka/Same-v0").steps_itself


def test_what_f_rests_on_is_hidden_from_rewards():
    plain, wanted = (registry.get(f"gym:Hopper-v5{setting}") for setting in ("", "+fitness=x_velocity"))
    assert "x_velocity" in plain.spec and "x_velocity" not in wanted.spec
    simulation = registry.make(wanted.env, worlds=4)
    simulation.reset()
    step = simulation.step(torch.ones(4, 3))
    torch.testing.assert_close(step.score.value, simulation.task.sparse_reward(step.state))
    assert step.score.weight.tolist() == [1.0] * 4
