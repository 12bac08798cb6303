"""A graph written as Python computes what the graph computes."""

import pytest
import torch

from openeureka.reward import gate, probe
from openeureka.reward import graph as graphs
from openeureka.reward.load import load
from openeureka.tasks import human, registry
from openeureka.types import Node, RewardGraph


@pytest.mark.parametrize("env", ["cartpole", "ant", "shadow_hand"])
def test_human_rewards_are_the_same_to_the_bit(env: str):
    simulation = registry.make(env, worlds=5)
    simulation.reset()
    state = simulation.step(torch.rand(5, simulation.task.num_actions) * 2.0 - 1.0).state
    task = type(simulation.task)
    program = gate.check(human.program(task), task.spec)
    assert isinstance(program, gate.Program)
    graph = probe.probe(load(program), task.spec, state).graph
    expected, parts = graphs.CompiledReward(graph, task.spec)(state)
    names: dict = {"torch": torch}
    exec(graphs.spelled(graph, task.spec), names)
    found, components = names["reward"](state)
    assert torch.equal(found, expected)
    assert components.keys() == parts.keys() and all(torch.equal(components[name], parts[name]) for name in parts)


def test_what_is_no_allowed_operation_is_not_spelled():
    nodes = (Node("input", ("dof_pos",)), Node("__import__.default", ("os",)))
    graph = RewardGraph(nodes=nodes, reward=0, components=())
    with pytest.raises(graphs.GraphError, match="not allowed"):
        graphs.spelled(graph, registry.get("cartpole").spec)
