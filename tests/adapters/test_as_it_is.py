"""Environments stepped by their own code: nothing is summed across episodes, and every run is the same to the bit."""

import dataclasses
import importlib.util
import sys
import tracemalloc

import numpy as np
import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

import gymnasium
from gymnasium import spaces

from openeureka.adapters.gym.documents import identifiers
from openeureka.adapters.gym.spaces import Actions, parts
from openeureka.config import RunConfig
from openeureka.errors import TaskError
from openeureka.method.prompts import facts
from openeureka.tasks import registry
from openeureka.tasks.context import context, informed
from openeureka.tasks.record import record_states
from openeureka.testing.conformance.task import TaskConformance
from openeureka.training.population import Population
from openeureka.types import LaneSpec, TrainBudget, TrainingResult

from . import worlds

STEP = 3
"""Column of `step` in the observation of `Clock`: the keys of a Dict are sorted, and `phase` takes three columns."""


def box2d(reason: str = "needs Box2D: pip install 'openeureka[gym]'") -> pytest.MarkDecorator:
    return pytest.mark.skipif(importlib.util.find_spec("Box2D") is None, reason=reason)


class TestPendulum(TaskConformance):
    env = "gym:Pendulum-v1+fitness=angular_velocity"
    random_worlds = 8


class TestCartPole(TaskConformance):
    env = "gym:CartPole-v1"
    random_worlds = 8


def actions(first: int, second: int, count: int = 2) -> torch.Tensor:
    row = torch.zeros(5)
    row[first], row[2 + second] = 1.0, 1.0
    return row.expand(count, -1)


def test_columns_of_whole_numbers_say_which_value_they_stand_for():
    """The table in the documentation names the two numbers, not their one-hot columns. The constructor of `Cells` takes
    no `render_mode`."""
    told = {v.name: v.meaning for v in registry.get("gym:Openeureka/Cells-v0").spec.variables}
    assert [told[f"observation_{i}"] for i in range(5)] == [
        f"1 where it observes {option}, else 0"
        for option in ("0 as number 1", "1 as number 1", "5 as number 2", "6 as number 2", "7 as number 2")
    ]
    assert not {"column_of_cart", "row_of_cart"} & set(told)
    assert {"value_max", "speed"} <= set(told) and "max" not in told  # `max` is a function in rewards
    simulation = registry.make("gym:Openeureka/Cells-v0", worlds=1)
    assert simulation.reset().tolist() == [[0.0, 1.0, 0.0, 1.0, 0.0]]


@pytest.mark.parametrize(("name", "documented"), [("Turned", False), ("Stacked", False), ("Heavy", True)])
def test_words_on_another_observation_are_no_names_of_this_one(name: str, documented: bool):
    names = registry.get(f"gym-asis:Openeureka/{name}-v0").spec.names
    assert ("pole_angle" in names) is documented and ("observation_0" in names) is not documented


def test_an_episode_that_ends_hands_over_its_last_observation_and_the_first_of_the_next():
    simulation = registry.make("gym:Openeureka/Short-v0", worlds=2)
    assert simulation.reset()[:, STEP].tolist() == [0.0, 0.0]
    seen, ended, paid, gained = [], [], [], []
    for _ in range(7):
        step = simulation.step(actions(1, 2))
        seen.append((float(step.final_observation[0, STEP]), float(step.observation[0, STEP])))
        ended.append(bool(step.terminated[0]))
        paid.append(float(simulation.task.human_reward(step.state)[0]))
        gained.append(float(step.score.value[0] * step.score.weight[0]))
    assert seen == [(1, 1), (2, 2), (3, 0), (1, 1), (2, 2), (3, 0), (1, 1)]
    assert ended == [False, False, True] * 2 + [False]
    assert paid == [10, 20, 30] * 2 + [10]
    assert gained == [0, 0, 60] * 2 + [0]  # the sum of the rewards, where an episode ends


def test_seeds_have_31_bits_and_every_remainder():
    simulation = registry.make("gym:Openeureka/Clock-v0", worlds=512)
    simulation.reset()
    seeds = simulation.sim.seeds
    assert len(set(seeds.tolist())) == 512 and int(seeds.min()) >= 0 and 2**30 < int(seeds.max()) < 2**31
    counts = torch.bincount(seeds % 4, minlength=4)  # 128 of each are expected, with a standard deviation of 10
    assert int(counts.min()) > 80 and int(counts.max()) < 176


def test_a_truncation_of_the_environment_is_a_time_out():
    simulation = registry.make("gym:Openeureka/Cut-v0", worlds=2)
    simulation.reset()
    steps = [simulation.step(actions(0, 0)) for _ in range(5)]
    assert [bool(step.timed_out[0]) for step in steps] == [False, False, False, True, False]
    assert not any(bool(step.terminated.any()) for step in steps)
    assert steps[3].final_observation[0, STEP] == 4.0 and steps[3].observation[0, STEP] == 0.0


def test_a_staggered_start_cuts_the_first_episodes_off_and_counts_none_of_them():
    simulation = registry.make("gym:Openeureka/Clock-v0", worlds=64)
    simulation.reset(stagger=True)
    firsts = torch.zeros(64, dtype=torch.bool)
    for _ in range(20):
        step = simulation.step(actions(0, 0, 64))
        whole = step.score.weight > 0.0
        assert not bool((whole & ~firsts & (step.final_observation[:, STEP] < 20.0)).any())
        firsts |= step.done
    assert bool(firsts.all())


def test_choices_reach_the_environment_and_rewards_see_ones():
    simulation = registry.make("gym:Openeureka/Clock-v0", worlds=2)
    simulation.reset()
    state = simulation.step(actions(1, 2)).state
    assert state["first"].tolist() == [1.0, 1.0] and state["second"].tolist() == [2.0, 2.0]
    assert state["actions"][0].tolist() == [0.0, 1.0, 0.0, 0.0, 1.0]
    assert state["phase"].tolist() == [[0.0, 1.0, 0.0]] * 2
    assert state["previous_obs_buf"][0].tolist() == [1.0, 0.0, 0.0, 0.0]  # phase 0 and step 0


def test_an_observation_that_is_a_table_is_one_variable():
    simulation = registry.make("gym:Openeureka/Traffic-v0", worlds=2)
    simulation.reset()
    table = simulation.step(actions(0, 0)).state["observation"]
    assert table.shape == (2, 3, 2) and table[1].tolist() == [[10.0, 11.0], [12.0, 13.0], [14.0, 15.0]]


def test_parts_of_a_reward_are_no_variables_under_any_of_their_names():
    names = registry.get("gym:Openeureka/Traffic-v0").spec.names
    assert set(names) == {"observation", "luck", "sparseness", "obs_buf", "previous_obs_buf", "actions"}


def test_the_environments_own_reward_is_no_variable():
    spec = registry.get("gym:Openeureka/Clock-v0").spec
    assert {"luck", "first", "second", "step", "phase"} <= set(spec.names)
    assert not {"reward_part", "words", "outcome"} & set(spec.names)  # `outcome` is what F gains in a step


def test_numbers_of_info_are_those_of_their_world_and_none_is_cut_to_its_neighbours_type():
    simulation = registry.make("gym:Openeureka/Teller-v0", worlds=8)
    simulation.reset()
    for _ in range(11):
        state = simulation.step(actions(0, 0, 8)).state
        whole = state["luck"] % 2 == 1
        assert 0 < int(whole.sum()) < 8
        assert torch.equal(state["half"], torch.where(whole, 1.0, 0.5))
        assert torch.equal(state["lap"], torch.where(whole, 0.0, 7.0))
    assert "touched" not in state  # its length varies, as that of a list of contacts does
    assert simulation.step(actions(0, 0, 8)).state["late"].tolist() == [[0.0]] * 8  # two numbers now: counts as missing


def test_what_f_needs_of_info_keeps_its_shape():
    simulation = registry.make("gym:Openeureka/Teller-v0+fitness=late[0]", worlds=8)
    simulation.reset()
    for _ in range(11):
        simulation.step(actions(0, 0, 8))
    with pytest.raises(TaskError, match=r"`late` of `info` has the shape \(2,\), but had \(1,\) before; keep it"):
        simulation.step(actions(0, 0, 8))


def test_continuous_actions_fill_the_range_of_the_box():
    task = registry.get("gym:Pendulum-v1")
    taken = task.survey.actions.taken(torch.tensor([[-1.0], [0.0], [0.5]]))
    assert taken.tolist() == [[-2.0], [0.0], [1.0]] and taken.dtype == np.float32  # torques of 2 N m at most


def test_a_box_with_one_bound_leaves_a_policy_that_begins_at_0_room():
    box = spaces.Box(np.float32([5, -np.inf, -1]), np.float32([np.inf, -5, np.inf]))
    actions = Actions(box, 3)
    assert actions.taken(torch.tensor([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])).tolist() == [[6, -6, 0], [7, -5, 1]]


def test_bounds_that_a_type_cannot_add_or_that_nobody_reaches_are_understood():
    bytes_ = Actions(spaces.Box(100, 200, (1,), np.uint8), 1)
    assert bytes_.taken(torch.tensor([[-1.0], [0.0], [1.0]])).tolist() == [[100], [150], [200]]
    most = float(np.finfo(np.float32).max)
    free = Actions(spaces.Box(np.float32([-most, 0]), np.float32([most, most])), 2)
    assert free.taken(torch.tensor([[0.0, 0.0], [0.5, -0.5]])).tolist() == [[0, 1], [0.5, 0.5]]
    whole = Actions(spaces.Box(0, 4, (1,), np.int64), 1)
    assert whole.taken(torch.tensor([[0.4], [0.9]])).tolist() == [[3], [4]]  # 2.8 and 3.8


@pytest.mark.parametrize("env", ["gym:CartPole-v1", pytest.param("gym:LunarLander-v3", marks=box2d())])
def test_a_saved_state_goes_on_where_it_was(env: str):
    first, second = registry.make(env, worlds=3), registry.make(env, worlds=3)
    first.reset(stagger=True)
    second.reset()
    generator = torch.Generator().manual_seed(0)
    played = torch.randn(60, 3, first.task.num_actions, generator=generator)
    for action in played[:40]:
        first.step(action)
    second.load_state_dict(first.state_dict())
    for action in played[40:]:
        left, right = first.step(action), second.step(action)
        assert torch.equal(left.observation, right.observation)
        assert torch.equal(first.task.paid, second.task.paid)


def test_a_training_goes_on_to_the_bit_where_it_was_saved():
    env, budget = "gym:CartPole-v1", TrainBudget(env_steps=4 * 4 * 64, worlds=4)
    lanes = [LaneSpec(id=name, program=name, seed=seed) for name, seed in (("human", 1), ("sparse", 2))]
    whole, begun, after = (Population(env, lanes, budget) for _ in range(3))
    list(whole.train())
    begun.until = 2
    list(begun.train())
    after.resume(begun.snapshot())
    list(after.train())
    assert whole.epoch == after.epoch == 4
    assert torch.equal(whole.ppo.network.flat, after.ppo.network.flat)
    assert torch.equal(whole.observation, after.observation)


@pytest.mark.parametrize("paused", [False, True])
def test_each_step_that_is_played_again_is_told(paused: bool):
    env, lane = "gym:Pendulum-v1", LaneSpec(id="a", program="human")
    budget = TrainBudget(env_steps=2 * 4 * 64, worlds=4)
    begun = Population(env, [lane], budget)
    begun.until = 1
    (*_, result) = begun.train()
    assert isinstance(result, TrainingResult)
    told: list[int] = []
    if paused:
        lane = dataclasses.replace(lane, paused=result.paused)
    after = Population(env, [lane], budget, alive=lambda: told.append(1))
    if not paused:
        after.resume(begun.snapshot())
    steps = int(begun.env.sim.memory()["steps"].sum())
    assert len(told) == 3 + steps > 3, "the task, its worlds and their start are told before the steps"


def test_names_come_from_the_documentation_and_no_word_of_what_counts():
    known = context("gym:CartPole-v1")
    assert known.state.names[:4] == ("cart_position", "cart_velocity", "pole_angle", "pole_angular_velocity")
    assert known.description.startswith("to balance the pole")
    assert "Push cart to the left" in known.source and "reward" not in known.source.lower()


def test_documentation_without_headings_is_not_denied():
    known = context("gym:Openeureka/Clock-v0+description=to wait")
    assert worlds.Clock.__doc__
    assert known.source == "Nothing of it is shown. All that a reward may use is in the state table."


def test_a_prompt_speaks_of_seconds_only_where_somebody_says_how_long_a_step_is():
    def said(env: str) -> str:
        known = informed(context(env), {}, RunConfig(env=env))
        return " ".join(fact for fact in known.facts if fact.startswith(("An episode", "The discount")))

    assert "500 steps of 0.02 s, 10 s in all" in said("gym:CartPole-v1")
    clock = "gym:Openeureka/Clock-v0+description=to wait"
    assert said(clock).startswith(
        "An episode has at most 20 steps. The discount is 0.99 a step: what comes 100 steps l"
    )
    told = said(f"{clock}+control_dt=0.5")
    assert "20 steps of 0.5 s, 10 s in all" in told and "100 steps (50 s) later" in told


def test_no_prompt_says_what_f_is_made_of():
    known = context("gym:CartPole-v1+fitness=-abs(pole_angle)")
    assert facts(known)[0] == "The task score: mean of a number over steps; higher is better."


@pytest.mark.parametrize("success", ["is_success", "success"])
def test_what_info_says_only_at_an_end_is_found_where_f_names_it(success: str):
    env = "gym:Openeureka/Solver-v0"
    simulation = registry.make(f"{env}+fitness={success}", worlds=16)
    assert simulation.task.score_unit == "share of episodes that succeed"
    assert simulation.task.spec == registry.get(env).spec  # what rewards may read does not depend on F
    simulation.reset()
    for _ in range(12):
        step = simulation.step(torch.zeros(16, 5))
    assert bool(step.ended.all()) and step.score.weight.tolist() == [1.0] * 16
    assert step.score.value.tolist() == (step.state["luck"] % 2 == 0).float().tolist()
    assert 0 < float(step.score.value.sum()) < 16


def test_a_strangers_package_is_imported_first():
    pytest.importorskip("minigrid", reason="needs minigrid: pip install minigrid")
    env = "gym:minigrid:MiniGrid-Empty-5x5-v0"
    task = registry.get(env)
    assert task.choices == (7,) and task.spec["image"].shape == (7, 7, 3) and task.episode_length == 100
    assert record_states(env, worlds=2, steps=4, keep=2)["direction"].shape == (4, 4)
    assert not registry.installed(env) and registry.installed("gym:CartPole-v1")
    assert not registry.installed("gym:Hopper-v5+xml_file=x.xml")


@pytest.mark.parametrize(
    "env, said",
    [
        ("gym:Hoper-v5", "Gymnasium has no `Hoper-v5`. Did you mean `Hopper-v5`?"),
        ("gym:Cells-v0", "Gymnasium has no `Cells-v0`. Did you mean `Openeureka/Cells-v0`?"),
        ("gym:no_such_package:X-v0", "needs the module `no_such_package`: install it, or set PYTHONPATH"),
        ("gym:typing-extensions:X-v0", "the installed one is called `typing_extensions`, so write that."),
        ("gym:no-such-package:X-v0", "needs the module `no-such-package`: install it, or set PYTHONPATH"),
        ("gym:my_env.py:My-v0", "gym: takes a module, not a file: use gym:my_env:My-v0, and put the file's folder on"),
        ("gym:Pong-v0", "Gymnasium has no `Pong-v0`. If a package registers it"),
        ("gym:json:X-v0", "Importing `json` does not register it: call what does in a module of your own, and name"),
        ("gym:", "Name an environment of Gymnasium after gym:, for example env=gym:CartPole-v1."),
        ("gym:CartPole-v1+gravity=3", "`CartPole-v1` cannot be made: it takes no `gravity`."),
        (
            "gym:Hopper-v5+frame_skp=2",
            "`Hopper-v5` cannot be made: it takes no `frame_skp`. Did you mean `frame_skip`?",
        ),
        ("gym:CartPole-v1+control_dt=0.1", "`control_dt` of `gym:CartPole-v1+control_dt=0.1` follows from"),
        ("gym:Hopper-v5+substeps=2", "set an argument of its constructor instead, such as frame_skip=2."),
        ("gym:Hopper-v5+num_actions=4", "`num_actions` of `gym:Hopper-v5+num_actions=4` follows from"),
        ("gym:CartPole-v1+episode_length=soon", "is a number of steps, not `soon`"),
        ("gym:CartPole-v1+episode_length=" + "1" * 5000, "is a number of steps, not `1111"),
        (
            "gym:CartPole-v1+fitness=cart_speed",
            "uses `cart_speed`, which the environment did not report in random play. It reported ",
        ),
        ("gym:Hopper-v5+fitness=__import__('os')", "is not understood"),
        ("gym:CartPole-v1+episode_length=²", "`episode_length` of CartPole-v1 is a number of steps, not `²`."),
    ],
)
def test_what_does_not_fit_is_one_sentence(env: str, said: str):
    with pytest.raises(TaskError) as caught:
        registry.get(env)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_an_environment_that_raises_is_named_with_its_error():
    with pytest.raises(
        TaskError, match=r"Faulty-v0` failed: .*/worlds\.py, line \d+, in `step`: ValueError: the battery is empty"
    ):
        registry.get("gym:Openeureka/Faulty-v0")


def test_an_environment_that_cannot_be_reset_as_training_does_is_named_before_any():
    with pytest.raises(TaskError, match=r"Pointed-v0` failed: .* in `reset`: KeyError: 'goal'"):
        registry.get("gym:Openeureka/Pointed-v0")


@pytest.mark.parametrize("step", [2, 12])
def test_an_environment_that_ends_python_is_named_as_one_that_raises(step: int):
    with pytest.raises(TaskError, match=r"Quitter-v0.* failed: .* in `step`: sys\.exit\('the assets are missing'\)"):
        simulation = registry.make(f"gym:Openeureka/Quitter-v0+cut={step}", worlds=2)
        simulation.reset()
        for _ in range(step):
            simulation.step(actions(0, 0))


def test_an_error_of_gymnasiums_while_it_is_made_is_no_word_on_its_name():
    def made():
        raise gymnasium.error.ResetNeeded("start the simulator first")

    gymnasium.register("Openeureka/Unready-v0", entry_point=made)
    with pytest.raises(
        TaskError, match=r"Unready-v0` cannot be made: .*py, line \d+, in `made`: ResetNeeded: start the simulator"
    ):
        registry.get("gym:Openeureka/Unready-v0")


def test_what_a_constructor_needs_is_named_as_a_setting():
    class Maze(worlds.Clock):
        def __init__(self, level, size):
            super().__init__()

    gymnasium.register("Openeureka/Maze-v0", entry_point=Maze)
    with pytest.raises(TaskError, match=r"Maze-v0` cannot be made: add \+level=VALUE\+size=VALUE, or register it"):
        registry.get("gym:Openeureka/Maze-v0")
    with pytest.raises(TaskError, match=r"Maze-v0` cannot be made: add \+level=VALUE, or register it"):
        registry.get("gym:Openeureka/Maze-v0+size=1")
    assert registry.get("gym:Openeureka/Maze-v0+level=1+size=2").num_actions == 5


def test_an_environment_that_ends_python_while_it_is_made_is_named_too():
    gymnasium.register("Openeureka/Unmade-v0", entry_point=lambda: sys.exit(0))
    with pytest.raises(TaskError, match=r"`Openeureka/Unmade-v0` cannot be made: .*: sys\.exit\(0\) was called"):
        registry.get("gym:Openeureka/Unmade-v0")


def test_pictures_and_what_is_no_number_are_refused_before_anything_trains():
    with pytest.raises(TaskError, match="Eye-v0` observes pictures, which no policy here can read"):
        registry.get("gym:Openeureka/Eye-v0")
    with pytest.raises(TaskError, match="observes a value that is not finite, within 8 random steps"):
        registry.get("gym:Openeureka/Void-v0+cut=1")
    with pytest.raises(TaskError, match=r"Vast-v0` observes a value beyond 3\.4e38, the largest in 32 bits; wrap it"):
        registry.get("gym:Openeureka/Vast-v0")
    with pytest.raises(TaskError, match=r"Several-v0` pays an array of the shape \(2,\) in a step; wrap it so that it"):
        registry.get("gym:Openeureka/Several-v0")


@pytest.mark.parametrize("shape", [(4, 84, 84), (3, 64, 48), (2, 64, 48, 3), (64, 48)])
def test_pictures_in_any_order_of_axes_are_refused(shape: tuple[int, ...]):
    with pytest.raises(TaskError, match="observes pictures"):
        parts(spaces.Box(0, 255, shape, np.uint8), "x")
    assert parts(spaces.Box(0, 255, (7, 7, 3), np.uint8), "x")[0].size == 147  # cells of a grid


def test_a_whole_number_beyond_its_space_is_no_other_option():
    simulation = registry.make("gym:Openeureka/Astray-v0+cut=12", worlds=2)
    simulation.reset()
    with pytest.raises(TaskError, match=r"Astray-v0.* failed: ValueError: it observes a number outside 0 to 2, "):
        for _ in range(12):
            simulation.step(actions(0, 0))


def test_a_number_of_many_options_takes_memory_for_itself_alone():
    (part,) = parts(spaces.MultiDiscrete([3, 60_000], start=[1, 0]), "x")
    tracemalloc.start()
    rows = part.rows(np.array([[1, 7], [3, 59_999]]))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert rows.shape == (2, 60_003) and rows.nonzero()[1].tolist() == [0, 10, 2, 60_002]
    assert most < 10 * rows.nbytes


def test_what_python_takes_for_no_name_is_no_part_of_one():
    assert identifiers(["x²", "Pole Angle (rad)", "2nd"]) == ["x", "pole_angle", "value_2nd"]


def test_a_name_that_means_something_else_in_a_reward_is_changed():
    names = context("gym:Openeureka/Void-v0").state.names
    assert {"value_class", "value_actions", "value_torch", "actions"} <= set(names)


def test_what_is_set_reaches_the_constructor_the_limit_and_the_intent():
    simulation = registry.make("gym:Openeureka/Clock-v0+end=2+episode_length=7+description=to wait", worlds=1)
    simulation.reset()
    assert [bool(simulation.step(actions(0, 0, 1)).terminated[0]) for _ in range(2)] == [False, True]
    assert simulation.task.time_limit() == 7 and simulation.task.description == "to wait"


def test_what_a_constructor_names_reaches_it_though_a_task_has_an_attribute_of_that_name():
    env = "gym:Openeureka/Set-v0+episode_length=3+model=4+name=5+memory=6+clip_observations=9.0+description=to wait"
    simulation = registry.make(env, worlds=1)
    simulation.reset()
    steps = [simulation.step(actions(0, 0, 1)) for _ in range(3)]
    assert [bool(step.timed_out[0]) for step in steps] == [False, False, True]
    assert [float(steps[0].state[f"given_{name}"]) for name in ("model", "name", "memory")] == [4.0, 5.0, 6.0]
    assert simulation.task.clip_observations == 9.0 and simulation.task.description == "to wait"


def test_a_device_that_gymnasium_knows_nothing_of_is_refused():
    with pytest.raises(TaskError, match="only on the CPU"):
        registry.get("gym:CartPole-v1").simulate(1, "cuda", 1)
