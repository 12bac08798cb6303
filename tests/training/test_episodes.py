"""Recorded episodes are thinned evenly, and show what other programs would have paid in them."""

import pytest
import torch
from safetensors.torch import load
from torch import Tensor

from openeureka.executors.local import LocalExecutor
from openeureka.sim import CpuSimulator
from openeureka.suite.isaac.cartpole import Cartpole
from openeureka.tasks import registry
from openeureka.tasks.task import Score, State
from openeureka.training import episodes
from openeureka.training.episodes import Recorder, rewards
from openeureka.training.evaluate import evaluate
from openeureka.training.population import Population
from openeureka.training.wire import pack_score, unpack_score
from openeureka.types import (
    NOMINAL,
    Dynamics,
    Episodes,
    LaneSpec,
    Node,
    RewardGraph,
    StateSpec,
    StateVar,
    TrainBudget,
    TrainingResult,
    TrainingState,
)

SPEC = StateSpec(
    (
        StateVar(name="step", meaning="the step", kind="world"),
        StateVar(name="scale", meaning="two", kind="float"),
        StateVar(name="num_envs", meaning="all of them", kind="num_envs"),
    )
)


def recorded(steps: int, lengths: list[int], lanes: int = 1) -> list[Episodes]:
    """Episodes of these lengths, whose state is the number of the step. The first lane is not recorded."""
    worlds = len(lengths)
    recorder = Recorder(SPEC, range(1, lanes + 1), worlds)
    long = torch.tensor(lengths).repeat(lanes + 1)
    for number in range(steps):
        state = {"step": torch.full((len(long),), float(number)), "scale": 2.0, "num_envs": len(long)}
        recorder.add(number, state, number < long)
    weight = torch.tensor(lengths, dtype=torch.float64)
    sums = torch.stack([3 * weight, weight, weight])
    return list(recorder.read([sums] * lanes))


def states(one: Episodes, episode: int) -> list[float]:
    values = load(one.states)["step"].tolist()
    return [value for value, owner in zip(values, one.owners, strict=True) if owner == episode]


def test_a_short_episode_is_kept_whole():
    (one,) = recorded(12, [5, 12])
    assert (one.fitness, one.steps) == ((3.0, 3.0), (5, 12))
    assert states(one, 0) == [0, 1, 2, 3, 4] and states(one, 1) == list(range(12))


def test_a_constant_that_is_turned_in_memory_is_written_as_it_reads():
    turned = torch.arange(6.0).view(3, 2).T
    recorder = Recorder(StateSpec((*SPEC.variables, StateVar(name="axes", meaning="turned", kind="constant"))), [0], 1)
    recorder.add(0, {"step": torch.zeros(1), "scale": 2.0, "axes": turned}, torch.ones(1, dtype=torch.bool))
    (one,) = recorder.read([torch.ones(3, 1, dtype=torch.float64)])
    assert torch.equal(load(one.states)["axes"], turned)


def test_of_a_long_one_steps_are_evenly_apart():
    (one,) = recorded(100, [30, 100])
    # At most 16 are kept: every step up to 15, every 2nd up to 31, every 4th up to 63, every 8th after that.
    assert states(one, 1) == list(range(0, 100, 8)) and states(one, 0) == [0, 8, 16, 24]


def test_bytes_are_bounded(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(episodes, "MAX_BYTES", 40)  # two worlds of 4 bytes: five steps, made even: four
    (one,) = recorded(100, [100, 100])
    assert states(one, 0) == [0, 32, 64, 96]


def test_each_lane_has_its_own_and_at_most_so_many_episodes():
    first, second = recorded(3, [3] * 20, lanes=2)
    assert len(first.fitness) == len(second.steps) == episodes.EPISODES
    assert first == second


def test_an_episode_in_which_fitness_has_no_weight_has_none():
    recorder = Recorder(SPEC, [0], 1)
    recorder.add(0, {"step": torch.zeros(1), "scale": 1.0}, torch.ones(1, dtype=torch.bool))
    (one,) = recorder.read([torch.tensor([[0.0], [0.0], [1.0]])])
    assert one.fitness == (None,)


ANGLE = RewardGraph(
    nodes=(Node("input", ("pole_angle",)), Node("abs.default", ({"ref": 0},)), Node("neg.default", ({"ref": 1},))),
    reward=2,
    components=(),
)
FAILS = RewardGraph(
    nodes=(Node("input", ("pole_angle",)), Node("log.default", ({"ref": 0},))), reward=1, components=()
)  # the log of a negative angle is NaN


def learnt() -> bytes:
    """A policy of Cartpole that is hardly trained."""
    trained = Population("cartpole", [LaneSpec(id="a", program="human")], TrainBudget(env_steps=16 * 8, worlds=8))
    (policy,) = (event.last for event in trained.train() if isinstance(event, TrainingResult))
    assert policy is not None
    return policy


def test_a_world_is_simulated_until_its_episode_ends(monkeypatch: pytest.MonkeyPatch):
    advance, played = CpuSimulator.step, list[int]()

    def step(sim: CpuSimulator, substeps: int) -> None:
        assert sim.playing is not None
        played.append(int(sim.playing.sum()))
        advance(sim, substeps)

    policy = learnt()
    monkeypatch.setattr(CpuSimulator, "step", step)
    (score,) = evaluate("cartpole", {"a": policy}, seed=0, episodes=8, threads=1)
    assert sum(played) == pytest.approx(8 * score.episode_length) and played[0] == 8 > played[-1]


def test_a_score_that_is_not_defined_counts_nowhere_without_weight(monkeypatch: pytest.MonkeyPatch):
    """A Cartpole whose F is defined only where an episode ended. Elsewhere it is NaN, like 0 / 0."""
    policy = learnt()
    (known,) = evaluate("cartpole", {"a": policy}, seed=0, episodes=8, threads=1)
    original = Cartpole.fitness

    def undefined(task: Cartpole, s: State, ended: Tensor) -> Score:
        score = original(task, s, ended)
        return Score(torch.where(score.weight > 0, score.value, torch.nan), score.weight)

    monkeypatch.setattr(Cartpole, "fitness", undefined)
    (score,) = evaluate("cartpole", {"a": policy}, seed=0, episodes=8, threads=1)
    assert score == known
    trained = Population("cartpole", [LaneSpec(id="a", program="human")], TrainBudget(env_steps=16 * 8 * 4, worlds=8))
    (result,) = (event for event in trained.train() if isinstance(event, TrainingResult))
    assert result.state is TrainingState.FINISHED and result.fitness is not None


def test_a_task_without_changed_worlds_has_one_score_for_each_policy(monkeypatch: pytest.MonkeyPatch):
    policy = learnt()
    (known,) = evaluate("cartpole", {"own": policy}, seed=0, episodes=8, threads=1)
    monkeypatch.setattr(Cartpole, "steps_itself", True)
    own, worlds = {"own": policy, "heavy": policy}, {"own": NOMINAL, "heavy": Dynamics(mass=1.5)}
    scores = evaluate("cartpole", own, seed=0, episodes=8, dynamics=worlds, threads=1)
    assert sorted((one.lane, one.fitness, one.episodes) for one in scores) == [
        *(("heavy", None, 0), ("own", known.fitness, 8)),
    ]


@pytest.mark.usefixtures("lasting")
def test_a_policy_that_was_played_tells_what_programs_would_have_paid(monkeypatch: pytest.MonkeyPatch):
    (score,) = evaluate("cartpole", {"a": learnt()}, seed=0, episodes=8, record=["a"], threads=1)
    own = score.recorded
    assert own is not None and len(own.fitness) == 8
    assert unpack_score(pack_score(score)).recorded == own
    # F of Cartpole is the length of an episode.
    assert own.fitness == pytest.approx(own.steps) and sum(own.steps) / 8 == pytest.approx(score.episode_length)
    angles = load(own.states)["pole_angle"]
    paid = LocalExecutor(threads=1).rewards("cartpole", {"angle": ANGLE, "fails": FAILS}, [own, own])
    assert set(paid) == {"angle"}
    assert paid["angle"] == pytest.approx([*(-angles.abs()).tolist()] * 2)
    alone = {"angle": pytest.approx((-angles.abs()).tolist())}
    assert dict(rewards("cartpole", {"angle": ANGLE}, [own])) == alone
    monkeypatch.setattr(episodes, "TOGETHER", 7)  # several batches
    assert len(angles) > 14 and dict(rewards("cartpole", {"angle": ANGLE}, [own])) == alone


@pytest.mark.parametrize("env", ["cartpole", "ant", "quadcopter", "shadow_hand_over"])
def test_every_variable_that_a_reward_may_name_is_recorded(env: str):
    simulation = registry.make(env, worlds=2, threads=1)
    simulation.reset()
    step = simulation.step(torch.zeros(2, simulation.task.num_actions))
    recorder = Recorder(simulation.task.spec, [0], 2)
    recorder.add(0, step.state, torch.ones(2, dtype=torch.bool))
    (one,) = recorder.read([torch.ones(3, 2)])
    named = {variable.name for variable in simulation.task.spec.variables if variable.kind != "num_envs"}
    assert set(load(one.states)) == named
