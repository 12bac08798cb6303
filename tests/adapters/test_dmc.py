"""dm_control's tasks, with a fake of its interface."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from openeureka.errors import TaskError
from openeureka.tasks import registry
from openeureka.tasks.context import context
from openeureka.tasks.env import BatchedEnv

from . import suites


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BatchedEnv]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", suites.faked(tmp_path_factory.mktemp("python"), "arms"))
        yield registry.make("dmc:arm-swing", worlds=3)


def moved(first: list[float], second: list[float]) -> torch.Tensor:
    return torch.tensor([first, second]).T


def test_observations_measures_and_joints_are_the_state_table(arm: BatchedEnv):
    known = context(arm.task.env)
    assert known.state.names[:5] == ("height", "position", "qpos", "qvel", "obs_buf")  # no `ball`, no `distance`
    assert known.state["height"].meaning == "the height of the arm" and known.state["position"].use != "point"
    assert known.state["qpos"].meaning.endswith(": root (7: x, y, z, quaternion w, x, y, z), hinge")
    assert known.description == "to do arm-swing of dm_control"
    assert "motor, winch" in known.source and "random height" in known.source
    assert "Args" not in known.source and "reward" not in known.source


def test_actions_fill_bounds_and_are_taken_as_they_are_where_there_is_none(arm: BatchedEnv):
    taken = arm.task.survey.actions.taken(torch.tensor([[-1.0, 0.5], [0.0, -0.5]]))
    assert taken.tolist() == [[-1.0, 0.5], [1.0, -0.5]]  # [-1, 3], and no bounds


def test_a_discount_of_0_terminates_and_the_time_limit_does_not(arm: BatchedEnv):
    arm.reset()
    steps = [arm.step(moved([0.0] * 3, [0.0, -1.0 if number == 2 else 0.0, 0.0])) for number in range(6)]
    assert [step.terminated.tolist() for step in steps] == [[False, number == 2, False] for number in range(6)]
    assert [step.timed_out.tolist() for step in steps] == [[number == 5, False, number == 5] for number in range(6)]
    paid = [float(step.score.value[0]) for step in steps]
    assert paid == [0.0] * 5 + [10.0 + 20 + 30 + 40 + 50 + 60]  # the sum of the rewards, where an episode ends


def test_broken_physics_begins_its_world_again_and_no_other(arm: BatchedEnv):
    arm.reset()
    before = arm.bad_total
    arm.step(moved([0.0] * 3, [0.0] * 3))
    step = arm.step(moved([0.0] * 3, [0.0, 1.0, 0.0]))
    assert step.bad.tolist() == [False, True, False] and arm.bad_total == before + 1
    assert arm.task.progress.tolist() == [2, 0, 2] and arm.task.paid[::2].tolist() == [20.0, 20.0]


@pytest.mark.parametrize(
    "env, words",
    [
        ("dmc:arm-kick", "dm_control has no arm-kick; it has arm-swing, arm-old."),
        ("dmc:wing-flap", "dm_control has no wing-flap; it has arm-swing, arm-old, leg-kick."),
        ("dmc:arm-old", "does not know MuJoCo 4.0.0: run pip install 'mujoco<4' in its Python."),
        ("dmc:arm-swing+speed=3", "cannot be made: TypeError"),
    ],
)
def test_what_cannot_be_made_is_one_sentence(arm: BatchedEnv, env: str, words: str):
    with pytest.raises(TaskError) as caught:
        registry.get(env)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_python_without_dm_control_says_what_to_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "sitecustomize.py").write_text("import sys; sys.modules['dm_control'] = None")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(TaskError, match="pip install dm_control 'mujoco<4', and set python=") as caught:
        registry.get(f"dmc:cheetah-run+python={sys.executable}")
    assert "\n" not in str(caught.value)
