"""Every string of the grammar is a program that runs. It is executed here because this package itself wrote it."""

import ast
from itertools import pairwise

import pytest
import torch

from openeureka.errors import TaskError
from openeureka.llm import grammar
from openeureka.llm.gbnf import parse
from openeureka.llm.random import RandomModel
from openeureka.reward import extract, gate
from openeureka.types import Prompt, StateSpec, StateVar

from .specs import ANT, CARTPOLE, HAND, HOPPER, SPECS

WORLDS = 5


def programs(spec: StateSpec, n: int, *, progress: bool = False) -> list[str]:
    prompt = Prompt(messages=(), grammar=grammar.grammar(spec, progress=progress), prefill=grammar.prefill(spec))
    return [extract.program(reply.text) or "" for reply in RandomModel().sample(prompt, n=n, seed=7)]


def leaves(spec: StateSpec, rule: str) -> list[str]:
    return [sequence[0].value for sequence in parse(grammar.grammar(spec)).get(rule, ())]


@pytest.mark.parametrize("env", SPECS)
@pytest.mark.parametrize("progress", [False, True])
def test_every_random_string_passes_the_gate_and_runs(env: str, progress: bool):
    spec = SPECS[env]
    generator = torch.Generator().manual_seed(0)
    state = {v.name: torch.randn(WORLDS, *v.shape, generator=generator) for v in grammar.offered(spec)}
    for source in programs(spec, 60, progress=progress):
        assert isinstance(gate.check(source, spec), gate.Program), source
        namespace: dict = {}
        exec(source, namespace)
        reward, components = namespace["compute_reward"](**state)
        assert reward.shape == (WORLDS,) and reward.isfinite().all(), source
        assert components and all(term.shape == (WORLDS,) for term in components.values()), source
        marks = [value for name, value in components.items() if name.startswith("progress_")]
        assert progress <= len(marks) <= 3 * progress, source
        assert all(((value >= 0.0) & (value <= 1.0)).all() for value in marks), source


@pytest.mark.parametrize("progress", [False, True])
def test_no_variable_of_a_task_is_overwritten_by_a_program(progress: bool):
    """Lunar Lander has a variable `x`, which a program's first term once overwrote."""
    named = ("x", "x_", "reward", "components")
    spec = StateSpec(tuple(StateVar(name=name, meaning="m", use="zero_centred") for name in named))
    for source in programs(spec, 40, progress=progress):
        assert isinstance(gate.check(source, spec), gate.Program), source
        (function,) = (node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef))
        bound = {
            node.id for node in ast.walk(function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        }
        assert bound == {"x__", "reward_", "components_"}, source
        namespace: dict = {}
        exec(source, namespace)
        _, components = namespace["compute_reward"](*(torch.full((WORLDS,), float(i)) for i in range(4)))
        assert all(name.startswith(("x", "reward", "components", "progress_")) for name in components), source


def test_arguments_are_the_offered_variables_in_the_order_of_the_table():
    assert [v.name for v in grammar.offered(CARTPOLE)] == ["cart_position", "pole_angle", "actions"]
    assert "    cart_position: torch.Tensor,\n    pole_angle: torch.Tensor,\n" in grammar.prefill(CARTPOLE)
    assert "dof_pos" not in grammar.prefill(CARTPOLE) + grammar.grammar(CARTPOLE)


def test_matrices_are_not_offered():
    assert "sensors" not in [v.name for v in grammar.offered(HAND)]


def test_zero_centred_variables_are_offsets_and_never_amounts():
    assert leaves(CARTPOLE, "offset") == ["cart_position", "pole_angle", "actions[:, 0]"]
    assert leaves(CARTPOLE, "amount") == []
    assert leaves(ANT, "spread") == ["dof_vel"]


def test_directional_variables_are_amounts_by_column_up_to_four_and_by_mean_beyond():
    assert leaves(ANT, "amount") == ["torso_velocity[:, 0]", "torso_velocity[:, 1]", "torso_velocity[:, 2]", "up_proj"]
    assert leaves(HAND, "amount") == ["torch.mean(fingertip_height, dim=-1)"]


def test_points_of_equal_size_are_compared_and_a_lonely_one_gives_its_coordinates():
    assert leaves(HAND, "gap") == ["object_position - goal_position"]
    assert leaves(HAND, "offset")[2] == "object_position[:, 2] - goal_position[:, 2]"
    assert leaves(HOPPER, "gap") == []
    assert leaves(HOPPER, "amount")[2] == "foot_position[:, 2]"


@pytest.mark.parametrize("env", SPECS)
def test_closeness_only_pays_and_magnitudes_only_cost(env: str):
    """A line `x = ...` of a magnitude is followed by a minus, one of a closeness by a plus."""
    for source in programs(SPECS[env], 60):
        lines = [line.strip() for line in source.splitlines()]
        for term, total in pairwise(lines):
            if term.startswith(("x = torch.abs", "x = torch.square", "x = torch.norm", "x = torch.sum")):
                assert total.startswith("reward = reward - "), source
            if term.startswith("x = torch.exp"):
                assert total.startswith("reward = reward + "), source


def test_a_task_that_marks_nothing_is_told_what_to_do():
    bare = StateSpec((StateVar(name="obs_buf", shape=(4,), meaning="all"),))
    with pytest.raises(TaskError, match="set `use` in its StateSpec"):
        grammar.grammar(bare)
