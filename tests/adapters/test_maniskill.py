"""ManiSkill's tasks, with a fake of its interface."""

from collections.abc import Iterator

import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from openeureka.errors import TaskError
from openeureka.tasks import registry
from openeureka.tasks.env import BatchedEnv
from openeureka.training import pausing

from . import suites

CPU = "maniskill:Reach-v1+sim_backend=physx_cpu+fitness=is_success"
GPU = "maniskill:Reach-v1+sim_backend=physx_cuda"


@pytest.fixture(scope="module", autouse=True)
def fakes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", suites.faked(tmp_path_factory.mktemp("python"), "arms"))
        yield


@pytest.fixture(scope="module", params=[CPU, GPU], ids=["cpu", "gpu"])
def reach(request: pytest.FixtureRequest) -> BatchedEnv:
    return registry.make(request.param, worlds=3)


def test_the_observation_and_what_info_says_are_the_state_table():
    known = registry.get(CPU)
    assert known.spec.names == (
        *("elapsed", "agent_qpos", "goal_pos", "tcp_to_goal_pos", "obs_buf", "previous_obs_buf", "actions"),
    )  # neither the empty array nor success
    assert known.spec["agent_qpos"].meaning == "positions of the joints [rad or m]: slide"
    assert known.spec["goal_pos"].use == "point" and known.spec["tcp_to_goal_pos"].use != "point"
    assert known.description == "to reach a mark" and "it is there" not in known.source


def test_worlds_step_are_paid_and_reset_each_for_itself(reach: BatchedEnv):
    start = reach.reset()[:, 0]
    assert float(start.min()) >= 0.0 and float(start.max()) <= 0.1
    for count in range(1, 6):
        step = reach.step(torch.tensor([[1.0], [0.0], [-1.0]]))
        if count < 5:
            torch.testing.assert_close(step.state["agent_qpos"][:, 0], start + count * torch.tensor([0.1, 0.0, -0.1]))
        first = reach.task.paid.tolist()
        assert [paid % 10.0 for paid in first] == ([0.0, 1.0, 2.0] if reach.task.env == GPU else [0.0] * 3)
        if bool(step.done.any()):
            break
    assert step.terminated.tolist() == [True, False, False]  # world 0 passed the mark at 0.5: success
    assert float(step.final_observation[0, 0]) > 0.5 and 0.0 <= float(step.observation[0, 0]) <= 0.1
    assert torch.equal(step.observation[1:], step.final_observation[1:])
    left = 6 - count
    ends = [reach.step(torch.zeros(3, 1)).timed_out.tolist() for _ in range(left)]
    assert ends == [[False] * 3] * (left - 1) + [[False, True, True]]


def test_f_may_be_the_share_of_episodes_that_succeed(reach: BatchedEnv):
    if reach.task.env == GPU:
        assert reach.task.score_unit == "sum of the environment's reward over an episode"
        return
    assert reach.task.score_unit == "share of episodes that succeed"
    reach.reset()
    scores = [reach.step(torch.tensor([[1.0], [0.0], [0.0]])).score for _ in range(6)]
    ended = [[float(score.value[world]) for score in scores if score.weight[world]] for world in range(3)]
    assert ended == [[1.0], [0.0], [0.0]]


def test_a_world_of_its_own_goes_on_where_it_was_and_a_batch_begins_anew(reach: BatchedEnv):
    seeded = reach.task.env == CPU
    reach.reset()
    reach.step(torch.ones(3, 1))
    saved = pausing.load(pausing.save(reach.state_dict()), torch.device("cpu"))
    left = reach.step(torch.zeros(3, 1)).final_observation
    reach.load_state_dict(saved)
    step = reach.step(torch.zeros(3, 1))
    assert torch.equal(left, step.final_observation) == seeded and step.bad.tolist() == [not seeded] * 3


@pytest.mark.parametrize(
    "env, words",
    [
        ("maniskill:Grab-v1", "ManiSkill has no Grab-v1; it has Bare-v1, Blind-v1, Reach-v1."),
        (
            "maniskill:Bare-v1+sim_backend=physx_cpu",
            "run python -m mani_skill.utils.download_asset Bare-v1 with its Python.",
        ),
        ("maniskill:Blind-v1+sim_backend=physx_cpu", "without Vulkan"),
    ],
)
def test_what_cannot_be_made_is_one_sentence(env: str, words: str):
    with pytest.raises(TaskError) as caught:
        registry.get(env)
    assert words in str(caught.value) and "\n" not in str(caught.value)
