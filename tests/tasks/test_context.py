"""What a language model is told about the tasks, in addition to what `TaskConformance` checks for every task."""

import ast
import inspect
import math
import re
import textwrap
from dataclasses import replace
from types import FunctionType
from typing import Any

import pytest

from openeureka.config import RunConfig
from openeureka.suite import TASKS as SUITE
from openeureka.tasks.context import context, informed
from openeureka.tasks.human import program
from openeureka.tasks.record import record_states
from openeureka.tasks.registry import get
from openeureka.tasks.task import Task


@pytest.mark.parametrize("env", SUITE)
def test_every_task_says_what_its_score_is(env):
    known = context(env)
    low, high = known.score_range
    assert known.score_unit and len(known.score_unit) < 50
    assert low is None or high is None or low < high


def test_a_changed_task_claims_no_bounds_of_its_score_and_no_ends_it_may_not_have():
    assert get("ant+fall_height=0.2").ends == "" and get("ant+episode_length=100").ends == get("ant").ends != ""
    assert get("cartpole").score_range == (0.0, 499.0)
    assert get("cartpole+episode_length=100").score_range == (None, None)


TASKS = [get(env) for env in SUITE]
SECRET = ("outcome", "fitness", "human_reward", "sparse_reward", "success_bonus", "success", "terminated")
COMMON = {0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0}  # numbers that mean nothing by themselves
COINCIDENT = {"franka_cabinet": {0.01, 0.02, 0.04}, "shadow_hand_catch_over2underarm": {20.0}}
"""Numbers that are also shown for another reason: of the arm's grasp points and drives, and of a hand's drives."""

LEAKY = """
import torch

from openeureka.suite.isaac.cartpole import Cartpole
from openeureka.tasks.task import mean_over_episodes

WANTED = 0.717
SCALE = 0.818  # of the angle
SECOND = 0.919


class Leaky(Cartpole):
    span = 0.616

    def __init__(self, *args) -> None:
        super().__init__(*args)
        self.bar = torch.tensor(0.515)
        self.unit = torch.tensor(0.414)

    def observe(self, s):
        return super().observe(s) * WANTED * SCALE * SECOND * self.bar * self.unit * self.span * self.told(s) * far(s)

    def told(self, s):
        return s["pole_angle"] * self.bar

    def fitness(self, s, ended):
        return mean_over_episodes(s["pole_angle"] < WANTED * self.bar * self.span * self.deep(s) * far(s), ended)

    def deep(self, s):
        return SECOND


def far(s):
    return s["cart_position"] > 0.313
"""


def test_what_the_score_names_too_is_never_shown(tmp_path):
    file = tmp_path / "leaky.py"
    file.write_text(LEAKY)
    source = context(str(file)).source
    assert "SCALE = 0.818  # of the angle" in source and "self.unit = torch.tensor(0.414)" in source
    assert "    def told(self, s): ..." in source and "def far(s): ..." in source
    for secret in ("0.717", "0.919", "0.515", "0.616", "0.313", "def deep"):
        assert secret not in source


def methods(task: type[Task]) -> dict[str, list[Any]]:
    """All definitions of each method in a task's own classes, by name."""
    found: dict[str, list[Any]] = {}
    for cls in task.__mro__:
        if issubclass(cls, Task) and cls is not Task:
            for name, value in vars(cls).items():
                if isinstance(value, FunctionType):
                    found.setdefault(name, []).append(value)
    return found


def parsed(function: Any) -> ast.AST:
    return ast.parse(textwrap.dedent(inspect.getsource(function)))


def secrets(task: type[Task]) -> tuple[set[str], set[float]]:
    """Module constants and numbers in the human reward, in the methods of `SECRET` and in what they call."""
    own, names, numbers = methods(task), set[str](), set[float]()
    written = [node.value for node in ast.walk(ast.parse(program(task))) if isinstance(node, ast.Constant)]
    numbers |= {float(value) for value in written if type(value) in (int, float)}
    waiting, seen = [function for name in SECRET for function in own.get(name, [])], set[Any]()
    while waiting:
        function = waiting.pop()
        if function in seen:
            continue
        seen.add(function)
        for node in ast.walk(parsed(function)):
            if isinstance(node, ast.Constant) and type(node.value) in (int, float):
                numbers.add(float(node.value))
            elif isinstance(node, ast.Attribute):
                waiting += own.get(node.attr, [])
            elif isinstance(node, ast.Name):
                value = function.__globals__.get(node.id)
                if type(value) in (int, float):
                    names.add(node.id)
                    numbers.add(float(value))
    return names, numbers - COMMON


def numbers(text: str) -> set[float]:
    return {float(word) for word in re.findall(r"(?<![\w.])\d+\.?\d*(?:e-?\d+)?(?![\w])", text)}


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.env)
def test_nothing_that_says_what_is_wanted_is_among_the_definitions(task):
    known = context(task.env)
    own = methods(task)
    motion = "\n".join(inspect.getsource(f) for name in ("apply_action", "compute_state", "observe") for f in own[name])
    names, values = secrets(task)
    assert not {name for name in names if re.search(rf"\b{name} = ", known.source)}
    for line in motion.splitlines():
        known = replace(known, source=known.source.replace(line, "", 1))
    told = known.source
    scales = {float(value) for cls in task.__mro__ for name, value in vars(cls).items() if name.endswith("_scale")}
    assert not (numbers(told) - numbers(motion) - scales - COINCIDENT.get(task.env, set())) & values
    for method in SECRET:
        assert f"def {method}" not in told
        for function in own.get(method, []):
            docstring = inspect.getdoc(function)
            assert not docstring or docstring.split(".")[0] not in told
    for word in ("fitness", "reward", "success", "recipe"):
        assert word not in told


@pytest.mark.parametrize(
    ("env", "defined"),
    [
        ("ballbalance", ["KNEE_SPEED = 20.0  # [rad/s] of the knee targets at full action", "def _wrench(self"]),
        (
            "ballbalance",
            ["def rotate(quat, vector): ", "self.rim_points = torch.tensor(RIM_POINTS", "RIM_POINTS = ((0.4"],
        ),
        ("quadcopter", ["TILT_LIMIT = 0.523599  # math.radians(30.0)", "MAX_THRUST = 2.0", "self.up = torch.tensor("]),
        ("anymal", ["self.default_dof_pos = torch.tensor(DEFAULT_ANGLES", "DEFAULT_ANGLES = (0.03, 0.4,"]),
        (
            "ant",
            ["def potential(self", "dof_vel_scale = 0.2", "return (2.0 * angle - upper - lower) / (upper - lower)"],
        ),
        ("shadow_hand_push_block", ["transition_scale = 0.5", "DRIVES = 20", "self.full_push = ", "_FORCE = 277.778"]),
    ],
)
def test_what_the_shown_methods_name_is_defined(env, defined):
    source = context(env).source
    assert [text for text in defined if text not in source] == []


@pytest.mark.parametrize("env", ["allegro_hand", "shadow_hand_re_orientation"])
def test_of_a_method_that_knows_the_goal_only_the_name_is_shown(env):
    assert "    def change_goals(self): ...\n" in context(env).source + "\n"


def test_statements_of_init_are_shown_for_what_they_name_alone():
    source = context("ballbalance").source
    assert "self.rest_position = " in source and "rewarded_position" not in source
    assert "max_command" not in context("anymal").source


def test_sums_in_meanings_have_their_brackets():
    assert get("quadcopter").spec["obs_buf"].meaning.startswith("(target - position) / 3,")


def terminating(task: type[Task]) -> set[float]:
    """Numbers in `terminated` and in what it calls, without their signs: literals, constants, the task's attributes,
    products of two."""
    own, found = methods(task), set[float]()
    waiting, seen = [*own.get("terminated", [])], set[Any]()
    while waiting:
        function = waiting.pop()
        if function in seen:
            continue
        seen.add(function)
        for node in ast.walk(parsed(function)):
            if isinstance(node, ast.Constant) and type(node.value) in (int, float):
                found.add(float(node.value))
            elif isinstance(node, ast.Attribute | ast.Name):
                name = node.attr if isinstance(node, ast.Attribute) else node.id
                waiting += own.get(name, [])
                value = function.__globals__.get(name, getattr(task, name, None))
                if type(value) in (int, float):
                    found.add(float(value))
                elif isinstance(value, FunctionType):
                    waiting.append(value)
    return {abs(a) for a in found} | {round(abs(a * b), 9) for a in found for b in found}


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.env)
def test_what_ends_an_episode_is_what_the_task_says(task):
    early = re.fullmatch(r"An episode ends early (?:when|as soon as) .*\.", task.ends)
    assert early or task.ends == "No episode ends early."
    assert numbers(task.ends) - terminating(task) == set()
    if not early:
        assert getattr(task, "reach", math.inf) == math.inf


def test_a_task_that_discounts_nothing_says_so(monkeypatch: pytest.MonkeyPatch):
    task = get("cartpole")
    monkeypatch.setattr(task, "recipe", replace(task.recipe, gamma=1.0))
    config = RunConfig(env="cartpole")
    facts = informed(context("cartpole"), record_states("cartpole", worlds=4, steps=3, keep=2), config).facts
    assert "Nothing is discounted: what comes later in an episode counts in full." in facts


def test_a_model_is_told_what_the_score_does_not_betray():
    config = RunConfig(env="quadcopter", steps=1_000_000, worlds=128)
    facts = informed(context("quadcopter"), record_states("quadcopter"), config).facts
    assert facts[0].startswith("An episode has at most 499 steps of 0.01 s, 4.99 s in all. An episode ends early when ")
    # 1,000,000 steps / (128 worlds * 32 steps an epoch) = 244.1
    assert facts[1] == "A policy trains for 1,000,000 steps in all: 244 epochs of 32 steps in each of 128 environments."
    assert facts[2].startswith("The discount is 0.99 a step: what comes 100 steps (1 s) later counts ")
    assert "  `up_proj` 1, `yaw_rate` 0" in facts
    # The target is at (0, 0, 1), and starts are at most 1.5 m from it along x, y and z.
    (position,) = (line for line in facts if line.startswith("  `position`"))
    low, high = map(float, re.findall(r"([\d.]+) to ([\d.]+) m from `target_position`", position)[0])
    assert 0 < low < 0.5 and 1.5 < high < math.hypot(1.5, 1.5, 1.5)


def test_of_many_points_each_is_told_once_and_a_hand_for_its_fingers():
    env = "shadow_hand_push_block"
    facts = informed(context(env), record_states(env), RunConfig(env=env)).facts
    lines = [line for line in facts if line.startswith("  ")]
    assert len(lines) <= 12 and not any("_hand_ff_" in line for line in lines)
    assert any(line.startswith("  `object_pos` (0, 0.2, 0.625) m, 0.2 m from `right_goal_pos`, ") for line in lines)
    assert not any(line.startswith("  `block_right_handle_pos`") for line in lines)  # it is at the object's centre


def test_a_short_vector_is_told_by_columns_where_it_is_not_zero():
    """ANYmal stands still at first, so its velocity error is the command: up to 2 m/s forward, 1 m/s to the left."""
    facts = informed(context("anymal"), record_states("anymal", steps=3, keep=2), RunConfig(env="anymal")).facts
    (line,) = (line for line in facts if "velocity_error" in line)
    forward, left = re.findall(r"(-?[\d.]+) to (-?[\d.]+)", line)[:2]
    assert -2.0 <= float(forward[0]) < -1.5 and 1.5 < float(forward[1]) <= 2.0
    assert -1.0 <= float(left[0]) < -0.7 and 0.7 < float(left[1]) <= 1.0
    assert "base_angular_velocity" not in line and "actions" not in line


def test_a_curriculum_is_told_as_the_steps_of_all_its_stages():
    config = RunConfig(env="shadow_hand_spin", curriculum="pen_spinning")
    facts = informed(context(config.env), record_states(config.env, worlds=4, steps=3, keep=2), config).facts
    assert facts[1] == "A policy trains for 60,000,000 steps in all, over the stages of a curriculum."


def test_safety_is_part_of_what_the_model_is_asked_for():
    told = informed(context("anymal"), {}, RunConfig(env="anymal", safety="torques below\x07 40 N m"))
    assert told.description.endswith("target velocities, and to do so safely: torques below 40 N m")
    assert informed(context("anymal"), {}, RunConfig(env="anymal")).description == context("anymal").description


def test_the_model_is_told_how_worlds_differ_where_they_do():
    said = [informed(context("ant"), {}, RunConfig(env="ant", randomise=name)).facts for name in ("none", "mild")]
    (fact,) = set(said[1]) - set(said[0])
    assert "mass 0.9 to 1.1 factor, friction 0.8 to 1.2 factor" in fact and "delay 0 to 0.02 s" in fact
