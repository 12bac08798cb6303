"""A person's own task in a file: examples/pendulum.py, named by its path."""

import inspect
import os
from pathlib import Path

import pytest
import torch

from openeureka.cli.main import main
from openeureka.config import RunConfig, short_name
from openeureka.errors import TaskError
from openeureka.executors.local import LocalExecutor
from openeureka.parsing import parse
from openeureka.store.directory import output_directory
from openeureka.tasks.context import context
from openeureka.tasks.record import record_states
from openeureka.tasks.registry import get, make
from openeureka.testing.conformance.task import TaskConformance
from openeureka.training.policy import Policy
from openeureka.types import LaneSpec, TrainBudget, TrainingResult, TrainingState

FILE = Path(__file__).parents[2] / "examples" / "pendulum.py"
ENV = f"{FILE}:Pendulum"


class TestPendulum(TaskConformance):
    env = ENV


def test_a_file_is_imported_once_and_its_source_can_be_read(monkeypatch):
    monkeypatch.chdir(FILE.parent)
    assert get("pendulum.py:Pendulum") is get(ENV)
    assert inspect.getsourcefile(get(ENV)) == str(FILE)
    assert "def apply_action" in context(ENV).source and "sparse_reward" not in context(ENV).source


def test_a_file_that_was_edited_is_another_task_from_then_on(tmp_path):
    file = tmp_path / "pendulum.py"
    for length in (9, 10):
        file.write_text(FILE.read_text().replace("episode_length = 200", f"episode_length = {length}"))
        assert get(str(file)).episode_length == length
        assert f"episode_length = {length}" in inspect.getsource(get(str(file)))


def test_files_of_the_same_name_are_different_tasks(tmp_path):
    (tmp_path / "pendulum.py").write_text(FILE.read_text().replace("episode_length = 200", "episode_length = 9"))
    assert get(f"{tmp_path}/pendulum.py:Pendulum").episode_length == 9
    assert get(ENV).episode_length == 200


@pytest.mark.parametrize(
    ("source", "name", "says"),
    [
        (None, "Mine", "There is no file "),
        ("class Mine(:\n", "Mine", "SyntaxError: invalid syntax (mine.py, line 1)"),
        ("open('no_such.xml')\n", "Mine", "No such file or directory: 'no_such.xml'"),
        ("1 / 0\n", "Mine", "ZeroDivisionError: division by zero"),
        ("import no_such_module\n", "Mine", "No module named 'no_such_module'"),
        ("class Mine: pass\n", "Mina", "There is no class `Mina`"),
        ("class Mine: pass\n", "Mina", "Did you mean `Mine`?"),
        ("class Mine: pass\n", "Mine", "is not a subclass of openeureka.tasks.task.Task"),
        ("from openeureka.tasks.task import Task as Mine\n", "Mine", "define apply_action, "),
        ("from openeureka.tasks.task import Task as Mine\n", "Mine", ", spec, recipe."),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path, source, name, says):
    file = tmp_path / "mine.py"
    if source is not None:
        file.write_text(source)
    with pytest.raises(TaskError) as caught:
        get(f"{file}:{name}")
    assert says in str(caught.value) and str(file) in str(caught.value)


def test_a_file_alone_names_its_only_task(tmp_path):
    assert get(str(FILE)) is get(ENV)
    assert get(f"{FILE}+episode_length=7").episode_length == 7
    file = tmp_path / "several.py"
    file.write_text(FILE.read_text() + "\n\nclass Other(Pendulum):\n    pass\n")
    with pytest.raises(
        TaskError, match=r"several\.py holds several tasks, Pendulum, Other: name one, such as env=.*:Pendulum"
    ):
        get(str(file))
    file = tmp_path / "none.py"
    file.write_text("from openeureka.suite.isaac.cartpole import Cartpole\n")
    with pytest.raises(TaskError, match="There is no task in"):
        get(str(file))
    with pytest.raises(TaskError, match="There is no file"):
        get("nowhere.py")


def test_a_trainer_finds_the_file_and_its_authors_packages_and_nothing_that_lies_around(tmp_path, monkeypatch):
    """What a person put on PYTHONPATH is found by every child; the working directory is on no child's path."""
    for folder, name, text in (
        ("lib", "gears", "RATIO = 1.0\n"),
        ("here", "glob", "raise RuntimeError('lies around')\n"),
        ("here", "tempfile", "raise RuntimeError('lies around')\n"),
    ):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / f"{name}.py").write_text(text)
    file = tmp_path / "geared.py"
    file.write_text(f"import gears\n{FILE.read_text()}".replace("from __future__ import annotations\n", ""))
    monkeypatch.chdir(tmp_path / "here")
    monkeypatch.setenv("PYTHONPATH", f"{os.pathsep}{tmp_path / 'lib'}")  # the empty entry is what many shells leave
    monkeypatch.syspath_prepend(tmp_path / "lib")
    (result,) = (
        message
        for message in LocalExecutor(threads=1).train(
            str(file), [LaneSpec(id="human-s0", program="human")], TrainBudget(env_steps=2000, worlds=4)
        )
        if isinstance(message, TrainingResult)
    )
    assert result.state is TrainingState.FINISHED, result.message


def test_a_repaired_file_can_be_imported_in_the_same_process(tmp_path):
    file = tmp_path / "pendulum.py"
    file.write_text("import\n")
    with pytest.raises(TaskError):
        get(f"{file}:Pendulum")
    file.write_text(FILE.read_text())
    assert get(f"{file}:Pendulum").__name__ == "Pendulum"


def test_settings_keep_the_whole_path_and_outputs_a_short_name(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert parse(RunConfig, ["env=tasks/mine.py:Mine"]).env == f"{tmp_path.resolve()}/tasks/mine.py:Mine"
    assert parse(RunConfig, ["env=mine.py+gain=2"]).env == f"{tmp_path.resolve()}/mine.py+gain=2"
    assert parse(RunConfig, ["env=my_package.mine:Mine"]).env == "my_package.mine:Mine"
    assert parse(RunConfig, ["env=ant"]).env == "ant"
    assert parse(RunConfig, ["env=gym:mine.py:My-v0"]).env == "gym:mine.py:My-v0"
    assert [
        short_name(env) for env in ("a b/c:d/mine.py:Mine", "c:d/mine.py", "my_package.mine:Mine", "ant", "lab/ant-2")
    ] == [
        "mine",
        "mine",
        "mine",
        "ant",
        "lab_ant_2",
    ]
    assert output_directory("", "/a/mine.py:Mine", "train_").name.endswith("_train_mine")
    assert output_directory("", f"gym:Hopper-v5+description=to hop {'ever ' * 60}higher").is_dir()


@pytest.mark.usefixtures("lasting")
def test_the_training_process_finds_a_task_that_was_named_from_another_directory(monkeypatch, tmp_path):
    monkeypatch.chdir(FILE.parent)
    env = parse(RunConfig, ["env=pendulum.py:Pendulum"]).env
    monkeypatch.chdir(tmp_path)
    trainer = LocalExecutor(threads=1)
    specs = [LaneSpec(id="h", program="human", seed=0)]
    *_, result = trainer.train(env, specs, TrainBudget(env_steps=4096, worlds=16))
    assert isinstance(result, TrainingResult) and result.state is TrainingState.FINISHED, result
    assert result.best_fitness is not None and Policy.from_bytes(result.best_fitness.policy).env == ENV


def test_a_command_checks_a_reward_against_a_task_in_a_file(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(FILE.read_text())
    (tmp_path / "reward.py").write_text(
        "import torch\n\n\ndef compute_reward(angle):\n    up = torch.cos(angle)\n    return up, {'up': up}\n"
    )
    with pytest.raises(SystemExit) as ended:
        main(["check", "env=mine.py:Pendulum", "reward.py"])
    assert ended.value.code == 0, capsys.readouterr()


def test_angles_are_measured_from_upright_and_wrapped():
    env = make(ENV, worlds=2, threads=1)
    env.reset()
    env.task.qpos[:, 0] = torch.tensor([0.1, 3 * torch.pi + 0.1])  # the second hangs, turned one and a half times
    assert env.task.compute_state()["angle"].tolist() == pytest.approx([0.1, 0.1 - torch.pi], abs=1e-5)


def test_the_motor_is_too_weak_to_lift_the_level_rod():
    env = make(ENV, worlds=1, threads=1)
    env.reset()
    env.task.qpos[:] = torch.pi / 2
    env.task.qvel[:] = 0.0
    env.sim.forward(torch.tensor([0]))
    # About its end a 1 kg rod of 1 m has inertia 1/3 kg m^2 (0.35 with the capsule's caps); gravity pulls with
    # 4.9 N m, the motor holds with 2 N m against it: (4.9 - 2) / 0.35 = 8.3 rad/s^2 over one step of 0.05 s.
    rate = env.step(-torch.ones(1, 1)).state["angular_velocity"]
    assert float(rate) == pytest.approx(8.3 * 0.05, rel=0.08)


def test_fitness_is_the_share_of_time_upright_and_the_human_reward_by_hand():
    task = make(ENV, worlds=2, threads=1).task
    state = {
        "angle": torch.tensor([0.1, -0.3]),
        "angular_velocity": torch.tensor([2.0, 0.0]),
        "actions": torch.tensor([[1.0], [0.0]]),
    }
    assert task.fitness(state, torch.zeros(2, dtype=torch.bool)).value.tolist() == [1.0, 0.0]
    # cos 0.1 - 0.01 * 4 - 0.001 = 0.954; cos 0.3 = 0.9553
    assert task.human_reward(state).tolist() == pytest.approx([0.9540, 0.9553], abs=1e-4)


@pytest.mark.parametrize("value", ["self.qvel[:, 0]", "self.qpos[:, 0].view(-1)"])
def test_a_forgotten_clone_is_named_before_anything_is_recorded(tmp_path, value):
    file = tmp_path / "mine.py"
    file.write_text(FILE.read_text().replace("self.qvel[:, 0].clone()", value))
    with pytest.raises(
        TaskError, match=r"`angular_velocity` of the task `pendulum` would change .* add \.clone\(\) to "
    ):
        make(str(file), worlds=2).reset()


@pytest.mark.parametrize("value", ["self.goal", "self.goal.view(-1)"])
def test_what_the_task_remembers_is_no_state_variable_as_it_is(tmp_path, value):
    """Without a copy, the last step of an episode would be rewarded for the next goal, which the reset writes."""
    file = tmp_path / "mine.py"
    text = FILE.read_text().replace("self.qvel[:, 0].clone()", value)
    text = text.replace("    recipe =", '    memory = ("goal",)\n    recipe =', 1)
    for method, line in (
        ("apply_action", "self.goal = torch.zeros(self.num_envs)"),
        ("fitness", "self.goal[worlds] = self.noise.uniform(worlds, 1)[:, 0]"),
    ):
        text = text.replace(f"    def {method}", f"        {line}\n\n    def {method}", 1)
    file.write_text(text)
    with pytest.raises(TaskError, match=r"`angular_velocity` .*, add \.clone\(\) to `self\.goal`\."):
        make(str(file), worlds=2).reset()
    file.write_text(text.replace(f'velocity": {value}', f'velocity": {value}.clone()'))
    make(str(file), worlds=2).reset()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("self.qvel[:, 0].clone()", "self.qvel[:, 0].double()", "`angular_velocity` as torch.float64; torch.float32"),
        ("self.qvel[:, 0].clone()", "self.qvel[:, 0] > 0", "`angular_velocity` as torch.bool; torch.float32"),
        (
            's["angular_velocity"]), dim=-1)',
            's["angular_velocity"]), dim=-1).double()',
            "observations as torch.float64",
        ),
        ('torch.zeros_like(s["angle"], dtype=torch.bool)', 'torch.zeros_like(s["angle"])', "must return torch.bool"),
    ],
)
def test_numbers_of_another_type_are_named_before_a_model_is_paid(tmp_path, old, new, says):
    file = tmp_path / "mine.py"
    text = FILE.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    with pytest.raises(TaskError) as caught:
        record_states(str(file), worlds=4, steps=3, keep=2)
    assert says in str(caught.value) and str(file) in str(caught.value)
