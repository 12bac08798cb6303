"""Environments that another process steps: the same numbers as in this process, and one sentence for every failure."""

import sys
from pathlib import Path

import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from processes import ends, running

from openeureka.adapters.foreign import link
from openeureka.config import RunConfig
from openeureka.errors import EurekaError, TaskError, WorkerError
from openeureka.executors.local import LocalExecutor
from openeureka.executors.transport import SILENCE
from openeureka.parsing import parse
from openeureka.tasks import registry
from openeureka.tasks.context import context
from openeureka.testing.conformance.task import TaskConformance
from openeureka.training.population import Population
from openeureka.types import LaneSpec, TrainBudget, TrainingResult, TrainingState

HERE = Path(__file__).parent
CARTS = f"python:{HERE / 'carts.py'}:Carts"


class TestCarts(TaskConformance):
    env = CARTS
    random_worlds = 8


def test_its_own_names_and_meanings_are_the_state_table_and_its_reward_is_none_of_it():
    known = context(CARTS)
    assert known.state.names == ("place", "speed", "mark", "obs_buf", "previous_obs_buf", "actions")
    assert known.state["speed"].meaning == "velocity [m/s]" and known.state["speed"].use == "directional"
    assert known.description.startswith("to stop at a mark") and registry.get(CARTS).episode_length == 40


@pytest.mark.parametrize(("name", "other"), [("listed", "poles"), ("listed_several", "several")])
def test_a_list_of_environments_steps_as_gymnasium_s_own_vector_does(name, other):
    ours, theirs = (registry.make(f"python:{HERE / 'vectors.py'}:{each}", worlds=3) for each in (name, other))
    assert ours.task.episode_length == theirs.task.episode_length == (500 if name == "listed" else 1000)
    assert ours.task.spec.names == theirs.task.spec.names
    assert ours.reset().tolist() == theirs.reset().tolist()
    ends = 0
    for number in range(60):
        action = torch.eye(ours.task.num_actions)[[0, 1, number % 2]]
        one, another = ours.step(action), theirs.step(action)
        assert one.observation.tolist() == another.observation.tolist() and one.done.tolist() == another.done.tolist()
        assert ours.task.human_reward(one.state).tolist() == theirs.task.human_reward(another.state).tolist()
        ends += int(one.terminated.sum())
    assert ends > 5 or name == "listed_several"  # a pole that is pushed one way falls within ten steps


def test_a_step_there_is_the_step_by_hand():
    simulation = registry.make(CARTS, worlds=3)
    start = simulation.reset()
    step = simulation.step(torch.tensor([[1.0], [0.0], [-1.0]]))
    assert step.state["speed"].tolist() == pytest.approx([0.6, 0.0, -0.6])  # 0.2 of 3 m/s
    assert step.state["place"].tolist() == pytest.approx((start[:, 0] + torch.tensor([0.03, 0.0, -0.03])).tolist())
    gap = (step.state["place"] - step.state["mark"]).abs()
    assert simulation.task.human_reward(step.state).tolist() == pytest.approx((-gap).tolist())


def test_what_is_set_reaches_what_makes_it_and_a_formula_names_its_state():
    simulation = registry.make(f"{CARTS}+pull=0.5+fitness=-abs(place - mark)", worlds=1)
    simulation.reset()
    step = simulation.step(torch.ones(1, 1))
    assert step.state.keys() == {"speed", "obs_buf", "previous_obs_buf", "actions", "outcome"}
    assert float(step.state["speed"]) == pytest.approx(0.3)
    assert float(step.score.value) == pytest.approx(
        -abs(float(step.state["obs_buf"][0, 0] - step.state["obs_buf"][0, 2]))
    )


def test_what_its_maker_names_reaches_it_though_a_task_has_an_attribute_of_that_name():
    env = f"python:{HERE / 'vectors.py'}:several+model=1.5+episode_length=7"
    simulation = registry.make(env, worlds=2)
    simulation.reset()
    state = simulation.step(torch.tensor([[0.0, 1.0]] * 2)).state
    assert state["value_1_far"].tolist() == [[1.5, 1.5]] * 2
    assert simulation.task.episode_length == 7  # no parameter of `several`, so it is the task's


def test_what_python_calls_nothing_reaches_what_makes_it_as_none():
    assert registry.get(f"{CARTS}+fault=None").opened.keywords["settings"] == {"fault": None}


def test_choices_and_dictionaries_cross_over():
    simulation = registry.make(f"python:{HERE / 'carts.py'}:Pair", worlds=2)
    simulation.reset()
    state = simulation.step(torch.tensor([[0.0, 1.0, 0.0, 0.0, 1.0]] * 2)).state
    assert simulation.task.choices == (2, 3)
    assert state["taken"].tolist() == [[1.0, 2.0]] * 2 and state["inner_double"].tolist() == [[2.0, 4.0]] * 2


def test_bits_and_choices_that_begin_at_one_cross_over_as_gymnasium_has_them():
    simulation = registry.make(f"python:{HERE / 'carts.py'}:Bits", worlds=2)
    simulation.reset()
    assert simulation.task.choices == (2, 2, 2)
    state = simulation.step(torch.tensor([[0.0, 1.0, 1.0, 0.0, 0.0, 1.0]] * 2)).state
    assert state["obs_buf"].tolist() == [[1.0, 0.0, 1.0]] * 2
    simulation = registry.make(f"python:{HERE / 'carts.py'}:Counted", worlds=2)
    simulation.reset()
    state = simulation.step(torch.tensor([[0.0, 1.0, 0.0, 0.0, 1.0]] * 2)).state
    assert state["obs_buf"].tolist() == [[2.0, 7.0]] * 2  # 1 + 1 of {1, 2}, and 5 + 2 of {5, 6, 7}


def test_observed_options_are_ones_among_zeros_as_in_this_python():
    simulation = registry.make(f"python:{HERE / 'vectors.py'}:cells", worlds=2)
    assert simulation.task.spec["observation_4"].meaning == "1 where it observes 7 as number 2, else 0"
    assert simulation.reset().tolist() == [[0.0, 1.0, 0.0, 1.0, 0.0]] * 2  # 1 of {0, 1} and 6 of {5, 6, 7}
    assert simulation.step(torch.tensor([[1.0, 0.0]] * 2)).observation.tolist() == [[1.0, 0.0, 0.0, 0.0, 1.0]] * 2


def test_a_tuple_of_observations_has_a_variable_for_each():
    simulation = registry.make(f"python:{HERE / 'vectors.py'}:several", worlds=2)
    simulation.reset()
    state = simulation.step(torch.tensor([[0.0, 1.0]] * 2)).state
    assert state["value_0"].tolist() == [[0.0, 1.0, 0.0]] * 2 and state["value_1_far"].tolist() == [[3.5, 3.5]] * 2


def test_a_file_imports_the_file_beside_it(tmp_path: Path):
    text = (HERE / "carts.py").read_text().replace("import numpy as np", "import numpy as np\nfrom link import PULL")
    (tmp_path / "carts.py").write_text(text.replace("pull=1.0", "pull=PULL"))
    (tmp_path / "link.py").write_text("PULL = 0.5")  # a file in the server's folder has this name too
    simulation = registry.make(f"python:{tmp_path / 'carts.py'}:Carts", worlds=1)
    simulation.reset()
    assert float(simulation.step(torch.ones(1, 1)).state["speed"]) == pytest.approx(0.3)


def test_an_action_that_an_environment_holds_on_to_stays_what_it_was():
    simulation = registry.make(f"python:{HERE / 'carts.py'}:Rated", worlds=1)
    simulation.reset()
    seen = [simulation.step(torch.full((1, 1), taken)).observation.item() for taken in (0.5, -0.5, 1.0)]
    assert seen == [0.5, -1.0, 1.5]


def test_whole_numbers_are_rounded_and_the_first_action_is_in_their_range():
    simulation = registry.make(f"python:{HERE / 'carts.py'}:Whole", worlds=2)
    simulation.reset()
    state = simulation.step(torch.tensor([[0.3, -0.3]] * 2)).state
    assert state["obs_buf"].tolist() == [[8.0, 6.0]] * 2  # 7 + 2 * 0.3 = 7.6, and 6.4
    assert state["actions"].tolist() == [[0.5, -0.5]] * 2  # rewards read the rounded action


def test_a_training_goes_on_to_the_bit_where_it_was_saved():
    budget = TrainBudget(env_steps=4 * 4 * 64, worlds=4)
    lanes = [LaneSpec(id=name, program=name, seed=seed) for name, seed in (("human", 1), ("sparse", 2))]
    whole, begun, after = (Population(CARTS, lanes, budget) for _ in range(3))
    list(whole.train())
    begun.until = 2
    list(begun.train())
    told: list[int] = []
    after.env.sim.after_replayed_step = lambda: told.append(1)
    after.resume(begun.snapshot())
    assert len(told) == int(begun.env.sim.memory()["steps"].max()) > 0
    list(after.train())
    assert torch.equal(whole.ppo.network.flat, after.ppo.network.flat)
    assert torch.equal(whole.observation, after.observation)


def test_python_is_a_part_of_the_name_and_its_path_is_made_whole():
    config = parse(RunConfig, ["env=mjlab:Mjlab-Cartpole", "python=~/mjlab/bin/python"])
    assert config.env == f"mjlab:Mjlab-Cartpole+python={Path.home()}/mjlab/bin/python"
    assert parse(RunConfig, ["env=cartpole", "python="]).env == "cartpole", "as `--help` shows it"
    inside = parse(RunConfig, ["python=python3", "env=python:carts.py:Carts"])
    assert inside.env == f"python:{Path.cwd()}/carts.py:Carts+python=python3"
    assert not registry.installed(inside.env)  # a run from elsewhere asks before it starts that program


@pytest.mark.parametrize("env", ["gym:CartPole-v1", "cartpole", str(HERE / "carts.py")])
def test_python_is_refused_where_the_environment_lives_in_this_one(env: str):
    config = parse(RunConfig, [f"env={env}", "python=python3"])
    with pytest.raises(TaskError) as caught:
        registry.get(config.env)
    said(caught.value, f"`python=` has no effect on `{env}`; it is for environments in another Python, such as python:")


# --- what goes wrong --------------------------------------------------------------------------------------------------


def stepped(env: str, steps: int) -> None:
    simulation = registry.make(env, worlds=2)
    simulation.reset()
    for _ in range(steps):
        simulation.step(torch.zeros(2, 1))


def said(error: EurekaError, *words: str) -> None:
    assert all(word in str(error) for word in words), str(error)
    assert "\n" not in str(error) and "Traceback" not in str(error)


def test_an_environment_that_raises_in_step_1000_is_named_with_its_error_and_line():
    with pytest.raises(TaskError) as caught:
        stepped(f"{CARTS}+fault=raise", 1000)
    said(caught.value, "carts.py:Carts", "failed: ValueError: the battery is empty (carts.py, line ")


@pytest.mark.parametrize(("place", "name"), [(1, "reward"), (2, "terminated"), (3, "truncated"), (4, "speed")])
def test_one_number_for_all_worlds_is_refused_by_name(place: int, name: str):
    simulation = registry.make(f"python:{HERE / 'carts.py'}:Shared+place={place}", worlds=2)
    simulation.reset()
    with pytest.raises(TaskError) as caught:
        simulation.step(torch.zeros(2, 1))
    said(caught.value, f"`step` returns `{name}` of shape (", "(2,) is needed, one per world")


def test_a_process_that_is_killed_is_told_as_such():
    with pytest.raises(WorkerError) as caught:
        stepped(f"{CARTS}+fault=kill+step=3", 3)
    said(caught.value, f"{sys.executable} ended while stepping `python:", "It was killed")


def test_sigterm_to_all_ends_no_environment_before_its_training_is_kept():
    stepped(f"{CARTS}+fault=terminate+step=3", 5)


def test_a_process_that_hangs_is_ended(monkeypatch: pytest.MonkeyPatch):
    simulation = registry.make(f"{CARTS}+fault=hang+step=3", worlds=2)
    simulation.reset()
    monkeypatch.setattr(link, "STEPPING", 0.5)  # a reset may take longer on a busy machine
    with pytest.raises(WorkerError) as caught:
        for _ in range(3):
            simulation.step(torch.zeros(2, 1))
    said(caught.value, "did not finish stepping", "in 0.5 s")


def test_who_hangs_is_ended_before_its_worker_is_taken_for_hung():
    assert max(link.STARTING + link.BEGINNING, 2 * link.STEPPING) <= SILENCE - 60, "the worker itself has a minute"


def test_what_it_prints_is_not_taken_for_an_answer():
    stepped(f"{CARTS}+fault=print+step=3", 6)


def test_a_python_that_prints_before_the_server_begins_is_understood(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "sitecustomize.py").write_text("print('welcome' * 9999, flush=True)")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    stepped(f"{CARTS}+pull=0.9", 2)


def test_a_server_of_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "server.py").write_text(link.SERVER.read_text().replace("VERSION = 1", "VERSION = 7"))
    monkeypatch.setattr(link, "SERVER", tmp_path / "server.py")
    with pytest.raises(TaskError) as caught:
        stepped(f"{CARTS}+pull=0.8", 1)
    said(caught.value, "is version 7, but version 1 is needed")


@pytest.mark.parametrize(
    "env, words",
    [
        (f"{CARTS}+python=/no/such/python", "/no/such/python cannot be started: No such file or directory."),
        (f"{CARTS}+python=true", "true cannot run the environment server"),
        (f"{CARTS}+weight=3", "cannot be made: TypeError"),
        (f"python:{HERE / 'carts.py'}:Cart", "carts.py has no `Cart`, perhaps `Carts`"),
        (f"python:{HERE / 'nowhere.py'}:Cart", "there is no file "),
        (f"python:{HERE / 'carts.py'}:resets_itself", "autoreset_mode=AutoresetMode.DISABLED"),
        (f"python:{HERE / 'vectors.py'}:single", "it is a single environment; return a list of `worlds` of them"),
        (f"python:{HERE / 'vectors.py'}:old", "or return a list of environments"),
        (
            f"python:{HERE / 'carts.py'}:Alone",
            "its observation has the shape (1, 3); a row for each of 2 worlds",
        ),
        ("python:no_such_package:make", "No module named 'no_such_package'"),
        ("python:carts", "name the factory of the environment: pkg.mod:factory"),
        ("mjlab:Mjlab-Cartpole", "lacks it: install it there, or set python= to the interpreter that has it"),
    ],
)
def test_what_cannot_be_made_is_one_sentence(env: str, words: str):
    with pytest.raises(TaskError) as caught:
        registry.get(env)
    said(caught.value, words)


def trained(env: str) -> TrainingResult:
    lanes = [LaneSpec(id="human", program="human", seed=1)]
    messages = LocalExecutor(threads=1).train(env, lanes, TrainBudget(env_steps=4 * 64 * 8, worlds=4))
    (result,) = [message for message in messages if isinstance(message, TrainingResult)]
    return result


def test_a_training_whose_other_process_dies_once_is_begun_again_by_itself(tmp_path: Path):
    result = trained(f"{CARTS}+fault=kill+step=40+file={tmp_path / 'died'}")
    assert (tmp_path / "died").exists() and result.state is TrainingState.FINISHED


def test_what_an_environment_started_ends_however_its_training_does(tmp_path: Path):
    messages = LocalExecutor(threads=1).train(
        f"{CARTS}+fault=leave+step=9+file={tmp_path / 'helper'}",
        [LaneSpec(id="human", program="human", seed=1)],
        TrainBudget(env_steps=4 * 64 * 8_000, worlds=4),
    )
    next(messages)
    helper = int((tmp_path / "helper-pid").read_text())
    assert running(helper)
    messages.close()  # its worker is killed at once, as there are no snapshots
    assert ends(helper)
