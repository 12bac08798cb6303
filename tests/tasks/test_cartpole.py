import pytest
import torch

from openeureka.suite.isaac.cartpole import Cartpole
from openeureka.tasks.registry import make


def state(position: float, velocity: float, angle: float, rate: float) -> dict[str, torch.Tensor]:
    names = ("cart_position", "cart_velocity", "pole_angle", "pole_velocity")
    return {name: torch.tensor([value]) for name, value in zip(names, (position, velocity, angle, rate), strict=True)}


@pytest.fixture
def task():
    return make("cartpole", worlds=2, threads=1).task


def test_the_model_has_the_specified_masses_and_force():
    model = Cartpole.compile_model()
    assert model.body("cart").mass == 1.0 and model.body("pole").mass == 1.0
    assert sorted(model.body("pole").inertia) == pytest.approx([0.0004, 0.0835, 0.0836], abs=1e-4)
    assert model.actuator("force").gear[0] == 400.0
    assert model.opt.timestep == pytest.approx(0.0083)


def test_episodes_start_within_the_specified_ranges():
    env = make("cartpole", worlds=2000, threads=1)
    env.reset()
    for values, limit in ((env.task.qpos, 0.1), (env.task.qvel, 0.25)):
        assert float(values.abs().max()) <= limit
        assert torch.all(values.max(0).values > 0.98 * limit) and torch.all(values.min(0).values < -0.98 * limit)


def test_a_positive_action_pushes_the_cart_forward_and_the_pole_back():
    env = make("cartpole", worlds=1, threads=1)
    env.reset()
    env.task.qpos[:] = 0.0
    env.task.qvel[:] = 0.0
    env.sim.forward(torch.tensor([0]))
    result = env.step(torch.tensor([[0.01]])).state
    # 4 N on a 1 kg cart that carries a 1 kg pole hinged below its centre: a = F / (2 - 0.47^2 / 0.3045) = 3.14 m/s^2
    assert float(result["cart_velocity"]) == pytest.approx(3.14 * 0.0166, rel=0.02)
    # Leaning the pole towards +y is a negative turn about x. The push leaves the pole behind.
    assert float(result["pole_velocity"]) == pytest.approx(3.14 * 0.47 / 0.3045 * 0.0166, rel=0.02)


def test_the_episode_fails_off_the_rail_or_below_the_horizontal(task):
    assert task.terminated(state(2.99, 0.0, 1.57, 0.0)).tolist() == [False]
    assert task.terminated(state(-3.01, 0.0, 0.0, 0.0)).tolist() == [True]
    assert task.terminated(state(0.0, 0.0, -1.58, 0.0)).tolist() == [True]


def test_fitness_is_the_length_of_finished_episodes(task):
    task.progress[:] = torch.tensor([60, 499])
    score = task.fitness({}, torch.tensor([True, False]))
    assert score.value.tolist() == [60.0, 499.0] and score.weight.tolist() == [1.0, 0.0]


def test_an_idle_cart_drops_the_pole_in_about_fifty_five_steps():
    env = make("cartpole", worlds=128, threads=1)
    env.reset()
    first = torch.zeros(128)
    while not first.all():
        step = env.step(torch.zeros(128, 1))
        ended = step.done & (first == 0)
        first[ended] = step.episode_length[ended].float()
    assert 45.0 < float(first.mean()) < 65.0
