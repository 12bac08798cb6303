"""Curricula by name and by file, and tasks with other class attributes."""

from pathlib import Path

import pytest

from openeureka.errors import ConfigError, TaskError
from openeureka.tasks import registry
from openeureka.tasks.curriculum import find
from openeureka.tasks.task import Stage

OTHER = """
from openeureka.suite.isaac.cartpole import Cartpole

class Longer(Cartpole):
    episode_length = 1000

class Wider(Cartpole):
    num_observations = 5

class Choosing(Cartpole):
    choices = (1,)
"""


@pytest.fixture
def written(tmp_path: Path):
    """A function that reads stages for cartpole from a YAML text. A file with three tasks is in the same folder."""
    (tmp_path / "other.py").write_text(OTHER)

    def written(text: str) -> tuple[Stage, ...]:
        (tmp_path / "stages.yaml").write_text(text)
        return find("cartpole", str(tmp_path / "stages.yaml"))

    return written


def test_pen_spinning_begins_with_random_goals_and_ends_with_the_task():
    first, last = find("shadow_hand_spin", "pen_spinning")
    assert registry.get(first.env).random_goals and not registry.get(last.env).random_goals  # pyright: ignore
    assert first.steps == last.steps == registry.get("shadow_hand_spin").recipe.env_steps


def test_two_lines_are_a_curriculum(written):
    first, last = written("- {set: {episode_length: 100}, steps: 2e4}\n- {}\n")
    assert (first, last) == (
        Stage(env="cartpole+episode_length=100", steps=20000),
        Stage(env="cartpole", steps=600_000),  # the steps of its recipe
    )
    assert registry.get(first.env).episode_length == 100


def test_a_stage_may_be_another_task_in_a_file_beside_the_list(written, tmp_path: Path):
    first, _ = written("- {env: 'other.py:Longer'}\n- {}\n")
    assert first.env == f"{tmp_path}/other.py:Longer"
    assert registry.get(first.env).episode_length == 1000


def test_a_stage_may_name_a_file_as_env_does(written, tmp_path: Path):
    (tmp_path / "alone.py").write_text(OTHER.partition("\nclass Wider")[0])
    first, _ = written("- {env: alone.py}\n- {}\n")
    assert first.env == f"{tmp_path}/alone.py" and registry.get(first.env).episode_length == 1000
    with pytest.raises(ConfigError, match=f"there is no file {tmp_path}/carts.py"):  # without `python:`
        written("- {env: 'python:carts.py:Carts'}\n- {}\n")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("- {env: ant}\n- {}\n", "stage 1 of .*: the observations of `ant` and `cartpole` differ"),
        ("- {env: 'other.py:Wider'}\n- {}\n", "the observations of .* differ"),
        ("- {env: 'other.py:Choosing'}\n- {}\n", "the choices of .* differ"),
        ("- {env: cartpol}\n- {}\n", "In stage 1 of .*Did you mean `cartpole`"),
        ("- {set: {episode_lenght: 100}}\n- {}\n", "has no `episode_lenght` to set. Did you mean `episode_length`"),
        ("- {set: {episode_length: long}}\n- {}\n", 'is 500; set it to another int, not to `"long"`'),
        ("- {set: {episode_length: 100}}\n", "The last stage .* is the task itself"),
        ("- {step: 5}\n- {}\n", "unknown key `step`; the keys are env, set, steps"),
        ("- {steps: many}\n- {}\n", "`steps` takes a whole number, zero or more"),
        ("- {steps: 1.5}\n- {}\n", "`steps` takes a whole number"),
        (
            "- {set: {episode_length: -5}}\n- {}\n",
            "`episode_length` of `cartpole` must be more than zero",
        ),
        ("- {set: {env: foo}}\n- {}\n", "has no `env` to set"),
        ("- {steps: -1}\n- {}\n", "does not fit"),
        ("steps: 5\n", "must be a list of stages"),
        ("[]\n", "must be a list of stages"),
        ("- {\n", "is not YAML"),
        ("[" * 3000, "is not YAML"),
    ],
)
def test_what_could_not_be_trained_is_refused_in_one_sentence(written, text: str, sentence: str):
    with pytest.raises(ConfigError, match=sentence) as refusal:
        written(text)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("env", "name", "sentence"),
    [
        ("shadow_hand_spin", "pen_spining", "Did you mean `pen_spinning`"),
        ("cartpole", "pen_spinning", "`cartpole` has no curriculum `pen_spinning`. It has none: name a YAML file"),
        ("cartpole", "no/such.yaml", "Cannot read the curriculum no/such.yaml: No such file"),
    ],
)
def test_a_curriculum_that_does_not_exist_is_refused(env: str, name: str, sentence: str):
    with pytest.raises(ConfigError, match=sentence):
        find(env, name)


def test_a_number_that_rewards_read_is_the_same_in_all_stages(tmp_path: Path):
    (tmp_path / "stages.yaml").write_text("- {set: {dof_vel_scale: 0.4}}\n- {}\n")
    with pytest.raises(ConfigError, match="rewards read `dof_vel_scale`, so it must be the same in all stages"):
        find("ant", str(tmp_path / "stages.yaml"))


def test_a_changed_task_keeps_the_rest():
    changed, known = registry.get("cartpole+episode_length=100+control_dt=1"), registry.get("cartpole")
    assert (changed.episode_length, known.episode_length) == (100, 500)
    assert changed.control_dt == 1.0 and isinstance(changed.control_dt, float)
    assert issubclass(changed, known)


def test_what_is_no_number_text_or_switch_cannot_be_changed():
    with pytest.raises(TaskError, match="has no `recipe` to set"):
        registry.get("cartpole+recipe=1")


class Told(registry.get("cartpole")):
    """A Cartpole whose human reward is text, as in a drafted task."""

    human = "def compute_reward(pole_angle):\n    return -pole_angle.abs(), {}\n"


def test_the_name_of_a_task_brings_no_program():
    registry.get(f"{__name__}:Told")
    with pytest.raises(TaskError, match="has no `human` to set"):
        registry.get(f'{__name__}:Told+human="def f(x): return x"')
