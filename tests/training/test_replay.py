import pytest
import torch

from openeureka.tasks.registry import get, make
from openeureka.training.population import Population
from openeureka.training.replay import Replay, waits
from openeureka.training.rewards import LaneRewards
from openeureka.types import LaneSpec, Node, RewardGraph, TrainBudget


def program(scale: float, name: str) -> RewardGraph:
    """scale * pole angle, with the angle as a component."""
    nodes = (Node("input", ("pole_angle",)), Node("mul.Tensor", ({"ref": 0}, scale)))
    return RewardGraph(nodes=nodes, reward=1, components=((name, 0),))


def picking() -> RewardGraph:
    """The pole angle where it is positive, picked by a mask and put into zeros."""
    nodes = (
        Node("input", ("pole_angle",)),
        Node("gt.Scalar", ({"ref": 0}, 0.0)),
        Node("index.Tensor", ({"ref": 0}, ({"ref": 1},))),
        Node("zeros_like.default", ({"ref": 0},)),
        Node("index_put.default", ({"ref": 3}, ({"ref": 1},), {"ref": 2})),
    )
    return RewardGraph(nodes=nodes, reward=4, components=(("picked", 4),))


def test_operations_that_wait_for_the_device_are_heard():
    x = torch.randn(4)
    assert waits(lambda: torch.where(x > 0, x, 0.0).sum()) == []
    assert waits(lambda: x[torch.tensor([1, 2])]) == []
    assert waits(lambda: bool(x.any())) == ["aten._local_scalar_dense.default"]
    assert waits(lambda: x[x > 0]) == ["aten.index.Tensor"]
    assert waits(lambda: (x > 0).nonzero()) == ["aten.nonzero.default"]
    assert waits(lambda: torch.tensor([1.0, 2.0]), uploads=True) == ["aten.lift_fresh.default"]


def test_a_number_written_at_an_index_is_sent_to_the_device():
    x, some, columns = torch.randn(4, 2), torch.tensor([1, 2]), torch.tensor([1, 0])

    def write(value):
        x[some, columns] = value  # at a single index PyTorch 2.15 fills by itself

    assert waits(lambda: write(3.0), uploads=True) == ["aten.index_put_.default"]
    assert waits(lambda: write(3.0)) == [], "an upload is allowed in a recording"
    assert waits(lambda: write(x.sum()), uploads=True) == []
    assert waits(lambda: x[:, 1].index_fill_(0, some, 3.0), uploads=True) == []


def test_off_a_gpu_a_function_is_called_as_it_is():
    seen = []
    run = Replay(lambda inputs: seen.append(inputs) or (inputs[0] + 1.0,))
    assert run([torch.ones(2)])[0].tolist() == [2.0, 2.0]
    assert run([torch.zeros(2)])[0].tolist() == [1.0, 1.0]
    assert len(seen) == 2


def test_rewards_that_pick_by_a_mask_run_beside_those_that_are_recorded():
    simulation = make("cartpole", worlds=5, lane_seeds=(0,) * 5, threads=1)
    simulation.reset()
    programs = (program(2.0, "a"), "human", picking(), program(3.0, "b"), program(4.0, "c"))
    rewards = LaneRewards(simulation.task, programs, 5)
    assert rewards.components == [(0, "a"), (2, "picked"), (3, "b"), (4, "c")]
    for _ in range(2):
        state = simulation.step(torch.rand(25, 1)).state
        early = (torch.arange(25) % 2).float()
        own, human, means = rewards(state, early)
        angle = state["pole_angle"].view(5, 5)
        assert torch.equal(own[1], human[1])
        assert torch.equal(own[0], 2.0 * angle[0]) and torch.equal(own[3:], angle[3:] * torch.tensor([[3.0], [4.0]]))
        assert torch.equal(own[2], angle[2].clamp(min=0.0))
        expected = [angle[0].mean(), angle[2].clamp(min=0.0).mean(), angle[3].mean(), angle[4].mean()]
        assert means[:, 0].tolist() == pytest.approx([float(x) for x in expected], abs=1e-7)  # means may cancel
        chosen = angle * early.view(5, 5)
        expected = [chosen[0].mean(), chosen[2].clamp(min=0.0).mean(), chosen[3].mean(), chosen[4].mean()]
        assert means[:, 1].tolist() == pytest.approx([float(x) for x in expected], abs=1e-7)  # means may cancel


def test_every_lane_reads_a_constant_of_the_task_whole():
    simulation = make("ant", worlds=3, lane_seeds=(0, 0), threads=1)
    simulation.reset()
    nodes = (
        Node("input", ("dof_limits_upper",)),
        Node("sum.default", ({"ref": 0},)),
        Node("input", ("actions",)),
        Node("select.int", ({"ref": 2}, 1, 0)),
        Node("add.Tensor", ({"ref": 3}, {"ref": 1})),
    )
    graph = RewardGraph(nodes=nodes, reward=4, components=())
    own, *_ = LaneRewards(simulation.task, [graph, graph], 3)(simulation.step(torch.zeros(6, 8)).state)
    # Hips turn by 40 degrees at most. Of the ankles two reach 100 and two -30: 4 * 40 + 2 * 100 - 2 * 30 degrees.
    assert own.flatten().rad2deg().tolist() == pytest.approx([300.0] * 6)


@pytest.mark.parametrize("bonus", ["none", "progress"])
def test_a_step_of_training_asks_a_gpu_nothing(bonus):
    specs = [LaneSpec(id="a", program=program(1.0, "progress_a")), LaneSpec(id="b", program="human")]
    population = Population("cartpole", specs, TrainBudget(worlds=8, bonus=bonus), threads=1)
    population.env.masked = True  # as on a GPU
    observation = population.env.reset().view(2, 8, get("cartpole").num_observations)

    def step() -> None:
        action = population.ppo.act(observation)
        taken = population.env.step(action.action.flatten(0, 1))
        early = (taken.episode_length <= 125).float()
        own, human, means = population.rewards(taken.state, early)
        population.curves.add(taken, own, human, means, early)
        paid = population.rewards.bonus(taken.state, taken.bad.view(2, 8), population.curves.moments)
        assert (paid is not None) == (bonus == "progress")
        population.ppo.value(taken.final_observation.view_as(observation))
        population.rollout.store(0, observation, action, own, taken.done.view(2, 8))

    step()  # the first one finds out which programs can be recorded
    assert waits(step, uploads=True) == []
