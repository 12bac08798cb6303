"""Tasks of mjlab and Isaac Lab, with fakes of their interfaces."""

import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from openeureka.reward import graph as graphs
from openeureka.tasks import registry
from openeureka.tasks.context import context
from openeureka.tasks.env import BatchedEnv

from . import suites
from .test_handed_back import graph_of, loaded

PROGRAM = """
def compute_reward(robot_joint_pos, robot_root_pos, {more}, actions):
    near = torch.exp(-(robot_joint_pos[:, 0] - 0.5).abs())
    more = {more}.reshape(len({more}), -1).sum(dim=-1)
    return near + robot_root_pos[:, 0] - 0.1 * actions.square().sum(dim=-1) + more, {{"near": near}}
"""
FAKES = {"mjlab:Fake-Carts": "command_mark", "isaaclab:Fake-Carts": "command_mark", "isaaclab:Fake-Carts-Direct": "gap"}


@pytest.fixture(scope="module", params=FAKES)
def simulation(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[BatchedEnv]:
    """Three worlds in another process. It runs the same Python, with the fake suites installed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", suites.faked(tmp_path_factory.mktemp("python"), "suites"))
        yield registry.make(request.param, worlds=3)


def test_the_state_is_that_of_the_scene_where_the_reward_is_computed(simulation: BatchedEnv):
    start = simulation.reset()
    assert start.shape == (3, 2) and float(start[:, 0].abs().max()) <= 0.5
    step = simulation.step(torch.tensor([[1.0], [0.0], [-1.0]]))
    state = step.state
    # Speed: 0.1 s at 3 m/s^2. Place: 0.1 s at the new speed.
    assert state["robot_joint_vel"][:, 0].tolist() == pytest.approx([0.3, 0.0, -0.3])
    moved = start[:, 0] + torch.tensor([0.03, 0.0, -0.03])
    assert state["robot_joint_pos"][:, 0].tolist() == pytest.approx(moved.tolist())
    assert state["robot_root_pos"][:, 0].tolist() == pytest.approx(moved.tolist(), abs=1e-5)  # from its world's origin
    assert state["robot_root_quat"].tolist() == [[0.0, 0.0, 0.0, 1.0]] * 3  # x, y, z, w
    scale = 1.0 if simulation.task.env.endswith("Direct") else 0.2  # a weight of 2, for 0.1 s
    paid = simulation.task.human_reward(state)
    assert paid.tolist() == pytest.approx((-scale * (moved - 0.5).abs()).tolist())
    assert not {"robot_actuator_force", "robot_root_lin_vel_b", "reward_buf"} & state.keys()


def test_worlds_are_reset_when_they_are_told_to_and_their_last_observation_is_seen(simulation: BatchedEnv):
    simulation.reset()
    for _ in range(20):
        step = simulation.step(torch.tensor([[1.0], [0.0], [0.0]]))
        if bool(step.done.any()):
            break
    assert step.terminated.tolist() == [True, False, False]
    assert float(step.final_observation[0, 0]) > 1.5 and float(step.state["robot_joint_pos"][0, 0]) > 1.5
    assert abs(float(step.observation[0, 0])) <= 0.5 and float(step.observation[0, 1]) == 0.0
    assert torch.equal(step.observation[1:], step.final_observation[1:])


def test_who_goes_on_from_a_saved_state_begins_new_episodes_that_count(simulation: BatchedEnv):
    simulation.reset()
    for _ in range(3):
        simulation.step(torch.ones(3, 1))
    simulation.load_state_dict(simulation.state_dict())
    step = simulation.step(torch.ones(3, 1))
    assert step.score.weight.tolist() == [0.0] * 3 and simulation.task.progress.tolist() == [0] * 3
    assert not bool(simulation.step(torch.ones(3, 1)).done.any())


def test_the_table_says_frames_units_and_joints_and_no_word_of_what_counts(simulation: BatchedEnv):
    known = context(simulation.task.env)
    assert known.state["robot_root_pos"].use == "point" and "world frame [m]" in known.state["robot_root_pos"].meaning
    assert known.state["robot_joint_pos"].meaning == "joint positions [rad or m] of slide"
    if "command_mark" in known.state:
        assert known.state["command_mark"].meaning == "what is commanded: mark"
    assert "near" not in known.source


def test_terms_pay_inside_the_suite_what_the_graph_paid(simulation: BatchedEnv, monkeypatch: pytest.MonkeyPatch):
    env, task = simulation.task.env, type(simulation.task)
    program = PROGRAM.format(more=FAKES[env])
    simulation.reset()
    graph = graph_of(task, program, simulation.step(torch.zeros(3, 1)).state)
    reward = graphs.CompiledReward(graph, task.spec)
    term: Any = loaded(task.handed_back(graph, program))

    modules: dict[str, ModuleType] = {}
    suites.install(modules)
    for module in modules.keys() - {"gymnasium"}:
        monkeypatch.setitem(sys.modules, module, modules[module])
    cfg = suites.configured(suites.of_mjlab if env.startswith("mjlab") else suites.of_isaaclab)
    cfg.scene.num_envs = 3
    if env.endswith("Direct"):
        theirs = suites.Direct(cfg)
        theirs._get_rewards = lambda: term.eureka(theirs)
    else:
        cfg.rewards = term.terms(suites.Base.step_dt)
        theirs = suites.ManagerBased(cfg)
    simulation.reset()
    theirs.reset(seed=int(simulation.sim.seeds[0] % 2**31))
    generator = torch.Generator().manual_seed(0)
    for _ in range(5):
        step = simulation.step(torch.rand(3, 1, generator=generator) - 0.5)
        _, paid, *_ = theirs.step(step.state["actions"])
        torch.testing.assert_close(paid, reward(step.state)[0])
