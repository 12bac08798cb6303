"""A program may compute with the rows that a mask picks, but not decide anything by how many they are."""

from __future__ import annotations

from typing import Any

import pytest
import torch

from openeureka.reward import examine, gate, graph, load, probe
from openeureka.reward.trace import Refused
from openeureka.types import Finding
from reward.honest import ANT, CARTPOLE, recorded

BEGINNING = """def f(dof_pos, dof_vel, obs_buf):
    x = dof_pos[:, 0]
    r = -x.abs()
    never, some, always = x > 1e9, x > 0.0, x < 1e9
"""


def judged(lines: str) -> Finding | probe.Traced:
    """The first finding about the program of `BEGINNING` and these lines; its trace if there is no finding."""
    body = "".join(f"    {line}\n" for line in lines.split("\n"))
    program = gate.check(f"{BEGINNING}{body}    return r, {{}}\n", CARTPOLE)
    assert isinstance(program, gate.Program), [finding.sentence() for finding in program]
    try:
        traced = probe.probe(load.load(program), CARTPOLE, recorded(CARTPOLE))
    except Refused as refusal:
        return refusal.finding
    found = examine.examine(traced, CARTPOLE, recorded(CARTPOLE))
    return found[0] if found else traced


DECISIONS = {
    "numel": "if r[MASK].numel() > 0:\n    r[MASK] = -10.0",
    "len": "if len(r[MASK]) > 0:\n    r[MASK] -= 10.0",
    "shape": "if x[MASK].shape[0]:\n    r[MASK] = -10.0",
    "size": "rows = x[MASK]\nif rows.size(0):\n    r[MASK] -= 10.0",
    "a loop": "for row in x[MASK]:\n    r = r - 10.0",
    "a factor": "k = min(1, len(x[MASK]))\nr = r * k",
    "which of two": "r = x if len(x[MASK]) > 0 else r",
    "what cannot be done with nothing": "r[MASK] = x[MASK].max() if len(x[MASK]) > 0 else 0.0",
    "a size": "r[MASK] = torch.zeros(len(x[MASK]))",
}


@pytest.mark.parametrize("mask", ["never", "some", "always"])
@pytest.mark.parametrize("name", DECISIONS)
def test_a_decision_by_how_many_elements_a_mask_picks_is_refused(name: str, mask: str) -> None:
    """If the mask never holds in the recorded states, the graph would lack the branch for when it does."""
    found = judged(DECISIONS[name].replace("MASK", mask))
    assert isinstance(found, Finding) and found.sentence() == (
        "line 5: how many elements this mask picks decides what is computed, and one decision would hold for all "
        "worlds [branch]; compute it for all worlds and pick with torch.where(mask, a, b)"
    )


@pytest.mark.parametrize(
    "line",
    [
        "r[some] += torch.einsum('ij,ij->i', dof_pos[some], dof_vel[some])",
        "r[never] += F.normalize(dof_pos[never], dim=-1)[:, 0]",
        "r[never] += dof_pos[never].flatten()[::2]",
    ],
)
def test_a_function_that_writes_the_size_down_is_told_how_to_do_without_a_mask(line: str) -> None:
    found = judged(line)
    assert isinstance(found, Finding) and (found.line, found.rule) == (5, "branch")
    assert found.fix == "compute it for all worlds and pick with torch.where(mask, a, b)"


COMPUTED = {
    "x[MASK] * 2.0": lambda x, v: 2.0 * x[:, 0],
    "dof_pos[MASK].norm(dim=-1)": lambda x, v: x.norm(dim=-1),
    "torch.cosine_similarity(dof_pos[MASK], dof_vel[MASK], dim=-1)": torch.cosine_similarity,
    "quat_to_angle_axis(obs_buf[MASK])[0] * 0.0 + 1.0": lambda x, v: torch.ones(len(x)),
}


@pytest.mark.parametrize("name", COMPUTED)
def test_what_is_computed_of_rows_that_were_never_picked_is_in_the_graph(name: str) -> None:
    traced = judged(f"r[never] += {name.replace('MASK', 'never')}")
    assert isinstance(traced, probe.Traced), traced
    torch.manual_seed(0)
    x, v = torch.randn(64, 2), torch.randn(64, 2)
    x[::2, 0] = 2e9  # the mask holds here, and in no recorded state
    state = {"dof_pos": x, "dof_vel": v, "obs_buf": torch.randn(64, 4)}
    reward, _ = graph.CompiledReward(traced.graph, CARTPOLE)(state)
    expected = -x[:, 0].abs()
    expected[::2] += COMPUTED[name](x[::2], v[::2])
    torch.testing.assert_close(reward, expected)


def test_an_empty_selection_is_judged_by_its_result() -> None:
    """The mean of no rows is NaN. `max()` of no rows fails, which is ignored where only tracing empties the mask."""
    found = judged("r = r + 0.0 * x[never].mean()")
    assert isinstance(found, Finding) and found.rule == "nan"
    found = judged("r[some] = x[some].max()")
    assert isinstance(found, Finding) and found.rule == "coupling"


def traced_of(source: str, states: dict[str, Any]) -> probe.Traced:
    program = gate.check(source, ANT)
    assert isinstance(program, gate.Program), [finding.sentence() for finding in program]
    traced = probe.probe(load.load(program), ANT, states)
    assert examine.examine(traced, ANT, states) == ()
    return traced


COLUMNS = {
    "HIPS = [True, False, True, False, True, False, True, False]": "torch.tensor(HIPS)",
    "": "torch.arange(8) % 2 == 0",
}
PICKED = {
    "r = (dof_pos[:, hips] * torch.tensor([1.0, 2.0, 0.0, 0.0])).sum(-1)": "b[:, 0] + 2.0 * b[:, 1]",
    "r = dof_pos[:, hips].view(num_envs, 2, 2).prod(-1).sum(-1)": "b[:, 0] * b[:, 1] + b[:, 2] * b[:, 3]",
    "a, b, c, d = dof_pos[:, hips].unbind(-1)\n    r = a - d": "b[:, 0] - b[:, 3]",
    "x = torch.zeros_like(dof_pos)\n    x[:, hips] = dof_pos[:, hips] * torch.tensor([1.0, 2.0, 3.0, 4.0])\n"
    "    x[:, ~hips] += 1.0\n    r = x[:, 6] + x[:, 1]": "4.0 * b[:, 3] + 1.0",
    "x = dof_pos.clone()\n    x[:, hips] = torch.tensor([5.0, 6.0, 7.0, 8.0])\n    r = x[:, 2] * dof_pos[:, 0]": (
        "6.0 * b[:, 0]"
    ),
    "r = dof_pos.view(-1, 2, 4)[:, hips.view(2, 4)].diff(dim=-1)[:, 0]": "b[:, 1] - b[:, 0]",
}


@pytest.mark.parametrize("constant", COLUMNS)
@pytest.mark.parametrize("lines", PICKED)
def test_a_constant_mask_picks_columns(lines: str, constant: str) -> None:
    source = (
        f"{constant}\n\ndef f(dof_pos, num_envs):\n    hips = {COLUMNS[constant]}\n    {lines}\n    return r, {{}}\n"
    )
    states = recorded(ANT)
    reward, _ = graph.CompiledReward(traced_of(source, states).graph, ANT)(states)
    torch.testing.assert_close(reward, eval(PICKED[lines], {"b": torch.as_tensor(states["dof_pos"])[:, ::2]}))


def test_a_mask_that_picks_every_world_is_no_list_of_worlds() -> None:
    source = (
        "def f(dof_pos, num_envs):\n    r = dof_pos[:, 0].clone()\n"
        "    r[torch.ones(num_envs, dtype=torch.bool)] += 1.0\n    return r, {}\n"
    )
    states = recorded(ANT)
    reward, _ = graph.CompiledReward(traced_of(source, states).graph, ANT)(states)
    torch.testing.assert_close(reward, torch.as_tensor(states["dof_pos"])[:, 0] + 1.0)


def test_who_picks_columns_by_limits_of_the_task_is_told_to_number_them() -> None:
    source = (
        "def f(dof_pos, dof_limits_upper):\n    picked = dof_pos[:, dof_limits_upper > dof_limits_upper[0]]\n"
        "    return (picked * torch.ones(picked.shape[1])).sum(-1), {}\n"
    )
    program = gate.check(source, ANT)
    assert isinstance(program, gate.Program)
    states = recorded(ANT)
    (finding,) = examine.examine(probe.probe(load.load(program), ANT, states), ANT, states)
    assert (finding.rule, finding.line) == ("operation", 3)
    assert finding.fix == "pick columns by number, as in `x[:, [0, 2]]`, not by a mask"


def test_what_a_constant_of_the_task_picks_may_be_counted() -> None:
    source = (
        "def f(dof_pos, dof_limits_upper):\n    picked = dof_pos[:, dof_limits_upper > dof_limits_upper[0]]\n"
        "    return picked.sum(-1) / (1 + picked.shape[1]), {}\n"
    )
    traced_of(source, recorded(ANT))
