"""Programs in the usual styles are accepted, and each graph computes what its program computes."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from openeureka.codec import decode, encode
from openeureka.reward import examine, gate, graph, load, probe, surface
from openeureka.reward import math as helpers
from openeureka.reward.trace import Refused
from openeureka.types import Finding, RewardGraph, StateSpec, StateVar
from reward.honest import ANT, CARTPOLE, PROGRAMS, recorded, sliced


def accepted(spec: StateSpec, source: str) -> probe.Traced:
    program = gate.check(source, spec)
    assert isinstance(program, gate.Program), [finding.sentence() for finding in program]
    states = recorded(spec)
    traced = probe.probe(load.load(program), spec, states)
    assert examine.examine(traced, spec, states) == ()
    return traced


def plain_python(
    spec: StateSpec, source: str, states: dict[str, Any], worlds: int
) -> tuple[torch.Tensor, dict[str, Any]]:
    """The program as its author would run it: real torch, no gate, no rewriting except the device and TorchScript."""
    everything = {**states, "num_envs": worlds, "device": "cpu"}
    names: dict[str, Any] = {
        "torch": torch,
        "math": math,
        **{n: getattr(helpers, n) for n in dir(helpers)},
        **everything,
    }
    text = source.replace("@torch.jit.script\n", "\n").replace('.to("cuda:0")', "").replace(".cuda()", "")
    text = text.replace(', device="cuda:0"', "").replace("self._closeness(", "_closeness(self, ")
    text = "\n".join(line for line in text.split("\n") if "isaacgym" not in line)
    before = set(names)
    exec(text, names)
    functions = [names[n] for n in names if n not in before and callable(names[n]) and hasattr(names[n], "__code__")]
    function = names.get("compute_reward", functions[-1])
    arguments = function.__code__.co_varnames[: function.__code__.co_argcount]
    if arguments[0] == "self":
        return function(SimpleNamespace(**everything))
    return function(**{name: everything[name] for name in arguments if name in everything})


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_graph_computes_what_the_program_computes(name: str) -> None:
    spec, source = PROGRAMS[name]
    traced = accepted(spec, source)
    compiled = graph.CompiledReward(decode(RewardGraph, encode(traced.graph)), spec)
    for worlds in (1, 33):
        states = recorded(spec, worlds, seed=worlds)
        before = {key: value.clone() for key, value in states.items() if isinstance(value, torch.Tensor)}
        reward, components = compiled(states)
        if worlds > 1:  # in a single world, `.squeeze()` would also drop the dimension of worlds
            expected, expected_components = plain_python(
                spec, source, {k: before.get(k, v) for k, v in states.items()}, worlds
            )
            torch.testing.assert_close(reward, expected.float(), rtol=1e-4, atol=1e-5)
            for value, wanted in zip(components.values(), expected_components.values(), strict=True):
                wanted = torch.as_tensor(wanted).float().expand(worlds)
                torch.testing.assert_close(value, wanted, rtol=1e-4, atol=1e-5)
        assert reward.shape == (worlds,) and reward.dtype == torch.float32
        assert all(value.shape == (worlds,) and value.dtype == torch.float32 for value in components.values())
        assert all(torch.equal(states[key], value) for key, value in before.items())  # type: ignore[arg-type]
        of_slices, _ = compiled(sliced(states))
        torch.testing.assert_close(of_slices, reward, rtol=1e-5, atol=1e-6)


def test_the_last_function_is_the_reward_and_its_helpers_survive() -> None:
    spec, source = PROGRAMS["module constants, helper with a default, print and assert"]
    program = gate.check(source, spec)
    assert isinstance(program, gate.Program)
    assert program.draft.entry.name == "compute_reward" and set(program.draft.functions) == {
        "tolerance",
        "compute_reward",
    }


def test_a_graph_of_a_usual_reward_is_small() -> None:
    spec, source = PROGRAMS["where on whole tensors as the original human reward"]
    # 2 inputs, 4 columns and about 20 arithmetic operations: none of Python's bookkeeping remains
    assert len(accepted(spec, source).graph.nodes) <= 30


def test_equal_expressions_are_computed_once() -> None:
    spec, _ = PROGRAMS["Python floats as components"]
    traced = accepted(spec, "def f(obs_buf):\n    return torch.cos(obs_buf[:, 2]) + torch.cos(obs_buf[:, 2]), {}\n")
    assert [node.op for node in traced.graph.nodes] == ["input", "select.int", "cos.default", "add.Tensor"]


@pytest.mark.parametrize("name", ["fingertips in a loop", "keepdim, squeeze and broadcasting against constants"])
def test_a_graph_runs_on_the_device_of_its_inputs(name: str) -> None:
    spec, source = PROGRAMS[name]
    compiled = graph.CompiledReward(accepted(spec, source).graph, spec)
    states = recorded(spec, 8)
    elsewhere = {key: value.to("meta") if isinstance(value, torch.Tensor) else value for key, value in states.items()}
    reward, components = compiled(elsewhere)  # a tensor left on the CPU would be an error
    assert all(value.device.type == "meta" for value in (reward, *components.values()))


@pytest.mark.parametrize(
    ("written", "name"),
    [("distance (m)", "distance_m"), ("</script><img onerror=x>", "script_img_onerror_x"), ("../../x,y", "x_y")],
)
def test_component_names_become_identifiers(written: str, name: str) -> None:
    spec, _ = PROGRAMS["Python floats as components"]
    traced = accepted(spec, f"def f(obs_buf):\n    r = obs_buf[:, 0]\n    return r, {{{written!r}: r}}\n")
    assert [component for component, _ in traced.graph.components] == [name]


@pytest.mark.parametrize(("key", "told"), [(3, "3 is no"), ("1st", "'1st' is no"), (("a", "b"), "a tuple is no")])
def test_what_is_no_component_name_is_told_by_name(key: object, told: str) -> None:
    with pytest.raises(Refused) as refusal:
        probe.component_name(key)
    assert refusal.value.finding.message == f"{told} proper name of a component"


@pytest.mark.parametrize("made", ["c = dict(x=x, device=-x)", "c = {'x': x}\n    c.update(device=-x)"])
def test_a_component_may_be_called_device(made: str) -> None:
    source = f"def f(dof_pos):\n    x = dof_pos[:, 0]\n    {made}\n    return x, c\n"
    assert [name for name, _ in accepted(ANT, source).graph.components] == ["x", "device"]


def test_a_reward_and_components_that_are_one_tensor_are_fine() -> None:
    spec, _ = PROGRAMS["Python floats as components"]
    source = "def f(obs_buf):\n    r = obs_buf[:, 0]\n    return r, {'a': r, 'b': r, 'c': obs_buf[:, 0].expand_as(r)}\n"
    assert len(accepted(spec, source).graph.components) == 3


def test_python_floats_stand_where_torch_wants_tensors() -> None:
    spec, _ = PROGRAMS["Python floats as components"]
    product = "torch.max(obs_buf[:, 0], 0.0) * torch.exp(-1.0) * torch.clip(1.5, 0, 1)"
    source = f"def f(obs_buf):\n    return {product}, {{}}\n"
    reward, _ = graph.CompiledReward(accepted(spec, source).graph, spec)({"obs_buf": torch.tensor([[2.0], [-2.0]])})
    torch.testing.assert_close(reward, torch.tensor([2.0 * math.exp(-1.0), 0.0]))


@pytest.mark.parametrize(
    ("name", "own", "doubled"),
    [
        ("dt", "dt = 2.0", "dt * x"),
        ("twice", "def twice(x):\n    return 2.0 * x", "twice(x)"),
        ("normalize_angle", "", "2.0 * normalize_angle(x)"),
        ("abs", "", "abs(-2.0) * x"),
    ],
)
def test_an_attribute_of_self_overwrites_nothing_of_that_name(name: str, own: str, doubled: str) -> None:
    spec = StateSpec((StateVar(name="angle", meaning="", shape=()), StateVar(name=name, meaning="", shape=())))
    source = f"{own}\ndef of(x):\n    return {doubled}\ndef f(self):\n    return of(self.angle) + self.{name}, {{}}\n"
    states = {"angle": torch.tensor([0.5, -0.5]), name: torch.tensor([3.0, 4.0])}
    reward, _ = graph.CompiledReward(accepted(spec, source).graph, spec)(states)
    torch.testing.assert_close(reward, torch.tensor([4.0, 3.0]))  # 2 * 0.5 + 3, 2 * -0.5 + 4


@pytest.mark.parametrize(
    ("first", "second", "dim"), [((6, 3, 4), (3, 4), 1), ((3,), (6, 3), 1), ((6, 3), (3,), -1), ((6, 1, 4), (3, 4), 2)]
)
def test_cosine_similarity_counts_dimensions_as_torch_does(
    first: tuple[int, ...], second: tuple[int, ...], dim: int
) -> None:
    x, y = torch.randn(first), torch.randn(second)
    torch.testing.assert_close(load._cosine_similarity(x, y, dim), torch.cosine_similarity(x, y, dim))


@pytest.mark.parametrize(("length", "dtype"), [(1e30, torch.float32), (300.0, torch.float16)])
def test_cosine_similarity_of_long_vectors_is_that_of_torch(length: float, dtype: torch.dtype) -> None:
    x, y = (length * part / part.norm(dim=-1, keepdim=True) for part in torch.randn(2, 64, 3))
    x, y = x.to(dtype), y.to(dtype)
    torch.testing.assert_close(load._cosine_similarity(x, y, -1), torch.cosine_similarity(x, y, -1))


FIRST_ARGUMENTS = {
    "torch.exp(-dt)": math.exp(-0.0166),
    "torch.sqrt(2.0) * torch.log(2.0)": math.sqrt(2.0) * math.log(2.0),
    "torch.pow(2.0, 3.0) + torch.clamp(0.5, 0.0, 0.25)": 8.25,
    "torch.tanh(0.5) - torch.abs(-0.5)": math.tanh(0.5) - 0.5,
}


@pytest.mark.parametrize("expression", FIRST_ARGUMENTS)
def test_functions_of_tensors_take_a_python_float(expression: str) -> None:
    source = f"def f(actions, dt):\n    return actions[:, 0] * ({expression}), {{}}\n"
    reward, _ = graph.CompiledReward(accepted(ANT, source).graph, ANT)({"actions": torch.ones(1, 8), "dt": 0.0166})
    torch.testing.assert_close(reward, torch.tensor([FIRST_ARGUMENTS[expression]]))


WITH_ARGUMENTS = {
    "add_": (0.5,), "addcmul_": (torch.tensor([2.0]), torch.tensor([3.0])), "clamp_": (0.25, 1.0), "clamp_max_": (1.0,),
    "clamp_min_": (1.0,), "clip_": (0.25, 1.0), "copy_": (torch.tensor([2.0]),), "div_": (2.0,), "fill_": (2.0,),
    "logical_and_": (torch.tensor([0.0]),), "logical_or_": (torch.tensor([0.0]),),
    "masked_fill_": (torch.tensor([True]), 2.0), "mul_": (2.0,), "pow_": (3.0,), "sub_": (0.5,),
}  # fmt: skip


@pytest.mark.parametrize("method", sorted(surface.IN_PLACE_METHODS))
def test_every_method_that_edits_a_fresh_tensor_does_so(method: str) -> None:
    arguments = WITH_ARGUMENTS.get(method, ())
    said = ", ".join(repr(a).replace("tensor", "torch.tensor") for a in arguments)
    edit = f"x = actions[:, 0].abs() + 0.25\n    x.{method}({said})"
    source = f"def f(actions):\n    {edit}\n    return x + actions[:, 1], {{}}\n"
    actions = torch.linspace(-1.5, 1.5, 24).view(3, 8)
    reward, _ = graph.CompiledReward(accepted(ANT, source).graph, ANT)({"actions": actions})
    x = actions[:, 0].abs() + 0.25
    getattr(x, method)(*arguments)
    torch.testing.assert_close(reward, x + actions[:, 1])


HELPER_IMPORTS = {
    "import isaacgym.torch_utils as tu": "tu.quat_rotate",
    "import isaacgym.torch_utils": "isaacgym.torch_utils.quat_rotate",
    "from isaacgymenvs.utils import torch_jit_utils": "torch_jit_utils.quat_rotate",
    "from isaacgymenvs.utils.torch_jit_utils import quat_rotate as turn, torch_rand_float": "turn",
    "from utils.torch_jit_utils import *": "quat_rotate",
    "from torch_utils import quat_rotate": "quat_rotate",
}


@pytest.mark.parametrize("line", HELPER_IMPORTS)
def test_helpers_are_found_where_the_original_keeps_them(line: str) -> None:
    call = f"{HELPER_IMPORTS[line]}(root_states[:, 3:7], root_states[:, 7:10])"
    source = f"{line}\ndef f(root_states):\n    return {call}[:, 0], {{}}\n"
    states = recorded(ANT, 16)
    reward, _ = graph.CompiledReward(accepted(ANT, source).graph, ANT)(states)
    root = states["root_states"]
    assert isinstance(root, torch.Tensor)
    torch.testing.assert_close(reward, helpers.quat_rotate(root[:, 3:7], root[:, 7:10])[:, 0])


def test_components_of_another_shape_are_recorded_as_means() -> None:
    components = (
        "{'joints': actions, 'one': torch.tensor([3.0]), 'flags': actions > 0.25, 'grid': actions.view(-1, 4, 2)}"
    )
    source = f"def f(actions):\n    return actions[:, 0], {components}\n"
    actions = torch.arange(16.0).view(2, 8) / 8
    _, found = graph.CompiledReward(accepted(ANT, source).graph, ANT)({"actions": actions})
    # means of 0, 1/8, ... 7/8 and of 8/8 ... 15/8; above 1/4 are five of eight, then all eight
    torch.testing.assert_close(found["joints"], torch.tensor([3.5 / 8, 11.5 / 8]))
    torch.testing.assert_close(found["grid"], found["joints"])
    torch.testing.assert_close(found["flags"], torch.tensor([5 / 8, 1.0]))
    torch.testing.assert_close(found["one"], torch.tensor([3.0, 3.0]))


def test_a_method_may_name_its_state_as_well() -> None:
    source = "def compute_reward(self, actions):\n    return self.dof_pos[:, 0] + actions[:, 0], {}\n"
    states = {"actions": torch.ones(3, 8), "dof_pos": torch.full((3, 8), 2.0)}
    reward, _ = graph.CompiledReward(accepted(ANT, source).graph, ANT)(states)
    assert reward.tolist() == [3.0, 3.0, 3.0]


SAME = {
    "a default of the local name, not of the constant": (
        "k = 0.5\n\ndef f(dof_pos):\n    k = 0.25\n    scaled = lambda x, k=k: k * x\n"
        "    return scaled(dof_pos[:, 0]), {}\n",
        "0.25 * dof_pos[:, 0]",
    ),
    "functions that remember the turn of a loop": (
        "def f(dof_pos):\n    parts = [lambda x, i=i: x[:, i] * i for i in range(3)]\n"
        "    return sum(part(dof_pos) for part in parts), {}\n",
        "dof_pos[:, 1] + 2.0 * dof_pos[:, 2]",
    ),
    "an inner function with a state variable and a constant as defaults": (
        "K = 2.0\n\ndef f(dof_pos):\n    def total(x, *, w=dof_vel, k=K * math.pi):\n"
        "        return k * x + 0.0 * w[:, 0]\n"
        "    return total(dof_pos[:, 0]), {}\n",
        "2.0 * math.pi * dof_pos[:, 0]",
    ),
    "a device for a helper": (
        "def zero(n, device):\n    return torch.zeros(n, device=device)\n\n"
        "def f(dof_pos, num_envs, device):\n    return zero(num_envs, device=device) + dof_pos[:, 0], {}\n",
        "dof_pos[:, 0]",
    ),
    "a device for a lambda": (
        "def f(dof_pos, device):\n    twice = lambda x, device: 2.0 * x\n"
        "    return twice(dof_pos[:, 0], device=device), {}\n",
        "2.0 * dof_pos[:, 0]",
    ),
    "a device for a function in a table": (
        "def f(dof_pos, device):\n    table = {'a': lambda x, device: 2.0 * x}\n"
        "    return table['a'](dof_pos[:, 0], device=device), {}\n",
        "2.0 * dof_pos[:, 0]",
    ),
    "a device for an imported function": (
        "from torch import zeros\n\ndef f(dof_pos):\n    return dof_pos[:, 0] + zeros(1, device='cuda:0'), {}\n",
        "dof_pos[:, 0]",
    ),
    "a device for a function under a name of the author's": (
        "def f(dof_pos):\n    zeros, ones = torch.zeros, torch.ones\n"
        "    return dof_pos[:, 0] * ones(1, device='cuda:0') + zeros(1, device='cuda:0'), {}\n",
        "dof_pos[:, 0]",
    ),
    "a device for a method": (
        "def twice(self, x, device):\n    return 2.0 * x\n\n"
        "def f(self):\n    return self.twice(self.dof_pos[:, 0], device=self.device), {}\n",
        "2.0 * dof_pos[:, 0]",
    ),
    "a device and a type by name": (
        "def f(dof_pos):\n    return 1.0 - (dof_pos[:, 0] < 0.0).to('cuda', dtype=torch.float32), {}\n",
        "1.0 - (dof_pos[:, 0] < 0.0).float()",
    ),
    "a device and a type": (
        "def f(dof_pos):\n    return 1.0 - (dof_pos[:, 0] < 0.0).to('cuda:0', torch.float32), {}\n",
        "1.0 - (dof_pos[:, 0] < 0.0).float()",
    ),
    "a device and how to get there": (
        "def f(dof_pos):\n    return dof_pos.to('cuda:0', non_blocking=True)[:, 0], {}\n",
        "dof_pos[:, 0]",
    ),
    "a helper that reads what is an argument of the reward": (
        "def bonus(x):\n    return x * dt * (dof_vel[:, 0] * 0.0 + 1.0)\n\n"
        "def f(dof_pos, dt, dof_vel):\n    dt, dof_vel = 2.0 * dt, None\n    return bonus(dof_pos[:, 0]) + dt, {}\n",
        "(dof_pos[:, 0] + 2.0) * dt",
    ),
    "a helper that reads how many worlds there are": (
        "def zero():\n    return torch.zeros(num_envs, device=device)\n\n"
        "def f(dof_pos, num_envs, device):\n    return dof_pos[:, 0] + zero(), {}\n",
        "dof_pos[:, 0]",
    ),
    "a static method": (
        "@staticmethod\ndef twice(x):\n    return 2.0 * x\n\n"
        "def f(self):\n    return self.twice(self.dof_pos[:, 0]), {}\n",
        "2.0 * dof_pos[:, 0]",
    ),
    "a power as a place": (
        "K = 2 ** 1\n\ndef f(dof_pos, j=2**0):\n    return dof_pos[:, K + j], {}\n",
        "dof_pos[:, 3]",
    ),
    "powers that are no whole numbers": (
        "K = 2 ** -1 * 10 ** 30\n\ndef f(dof_pos):\n    return dof_pos[:, 0] + 1.0 / K, {}\n",
        "dof_pos[:, 0] + 2e-30",
    ),
    "a logarithm times a number, either way round": (
        "def f(dof_pos):\n    x = dof_pos[:, 0].abs() + 0.5\n"
        "    return torch.xlogy(x, 2) + x.xlogy(2) + torch.xlogy(3.0, x), {}\n",
        "2.0 * (dof_pos[:, 0].abs() + 0.5) * math.log(2.0) + 3.0 * torch.log(dof_pos[:, 0].abs() + 0.5)",
    ),
    "a bound that is a number and one that is a tensor": (
        "def f(dof_pos, dof_limits_upper):\n    low = torch.clamp(dof_pos, min=-0.25, max=dof_limits_upper)\n"
        "    high = torch.clip(dof_pos, -dof_limits_upper, 1)\n    return (low + 2.0 * high).sum(-1), {}\n",
        "(dof_pos.clamp(min=-0.25).minimum(dof_limits_upper) + "
        "2.0 * dof_pos.maximum(-dof_limits_upper).clamp(max=1.0)).sum(-1)",
    ),
    "zeros of the dtype of an input": (
        "def f(dof_pos):\n    return (dof_pos[:, :3] - dof_pos.new_zeros(3)).sum(dim=-1), {}\n",
        "dof_pos[:, :3].sum(dim=-1)",
    ),
    "an edit of a tensor that has the type already": (
        "def f(dof_pos):\n    a = torch.zeros_like(dof_pos[:, 0])\n    b = a.type_as(dof_pos)\n"
        "    b += dof_pos[:, 0]\n    return a + b + (dof_pos[:, 1] > 0).type_as(other=dof_pos), {}\n",
        "2.0 * dof_pos[:, 0] + (dof_pos[:, 1] > 0).float()",
    ),
    "fewer digits": (
        "def f(dof_pos):\n    return dof_pos[:, 0].bfloat16(), {}\n",
        "dof_pos[:, 0].to(torch.bfloat16)",
    ),
    "ones of the dtype of an input": (
        "def f(dof_pos):\n    return dof_pos[:, 0] * dof_pos.new_ones(1), {}\n",
        "dof_pos[:, 0]",
    ),
    "numbers of the dtype of an input": (
        "def f(dof_pos):\n    return (dof_pos[:, :3] * dof_pos.new_full((3,), 0.5)).sum(dim=-1), {}\n",
        "0.5 * dof_pos[:, :3].sum(dim=-1)",
    ),
}


@pytest.mark.parametrize("name", SAME)
def test_what_people_write_computes_what_they_mean(name: str) -> None:
    source, meant = SAME[name]
    states = recorded(ANT, 16)
    plain = f"def f(dof_pos, dof_limits_upper):\n    return {meant}, {{}}\n"
    own, expected = (graph.CompiledReward(accepted(ANT, text).graph, ANT)(states)[0] for text in (source, plain))
    torch.testing.assert_close(own, expected)


def refused(spec: StateSpec, source: str) -> Finding:
    program = gate.check(source, spec)
    assert isinstance(program, gate.Program)
    with pytest.raises(Refused) as refusal:
        probe.probe(load.load(program), spec, recorded(spec))
    return refusal.value.finding


@pytest.mark.parametrize(
    ("line", "sign", "fix"),
    [
        ("x = x << 1", "`<<`", "write `a * 2**b`"),
        ("x = 1 << x", "`<<`", "write `a * 2**b`"),
        ("x = x >> 1", "`>>`", "write `a // 2**b`"),
        ("x <<= 1", "`<<`", "write `a * 2**b`"),
        ("x >>= 1", "`>>`", "write `a // 2**b`"),
    ],
)
def test_a_shift_is_named_as_it_is_written(line: str, sign: str, fix: str) -> None:
    finding = refused(ANT, f"def f(actions):\n    x = (actions[:, 0] > 0).int()\n    {line}\n    return x, {{}}\n")
    assert sign in finding.message and finding.fix == fix


@pytest.mark.parametrize("made", ["torch.Tensor(1)", "torch.FloatTensor(1)"])
def test_who_makes_a_tensor_of_no_numbers_is_told_how_to_make_one_of_zeros(made: str) -> None:
    finding = refused(ANT, f"def f(dof_pos):\n    return dof_pos[:, 0] + {made}.fill_(1.0), {{}}\n")
    assert finding.sentence() == (
        "line 2: the operation `torch.Tensor(n)` cannot be part of a reward [operation]; "
        "use `torch.zeros(n)`, or `torch.tensor([...])` for numbers"
    )


def test_what_differs_between_a_graph_and_its_program_is_named() -> None:
    states = recorded(ANT, 8)
    traced = accepted(ANT, "def f(dof_pos):\n    x = dof_pos[:, 0]\n    return x, {'a': 2.0 * x}\n")
    reward, components = graph.CompiledReward(traced.graph, ANT)(states)
    with pytest.raises(Refused, match="disagree on component `a`"):
        probe._compare(traced.graph, {**states, "num_envs": 8}, (reward, {"a": components["a"] + 1.0}))


def test_what_a_function_takes_is_said_where_it_is_called_otherwise() -> None:
    source = "def f(dof_pos, dof_limits_upper):\n    return dof_pos.clamp(0.0, dof_limits_upper).sum(-1), {}\n"
    assert "expected one of: * (Tensor min = None, Tensor max = None)" in refused(ANT, source).message


def test_a_component_may_begin_with_no_other_letter() -> None:
    finding = refused(ANT, "def f(dof_pos):\n    return dof_pos[:, 0], {'\u03b8': dof_pos[:, 1]}\n")
    assert finding.fix == "start its name with a letter from A to Z"


@pytest.mark.parametrize("weight", ["1.0 / num_envs", "torch.arange(num_envs)", "torch.linspace(0, 1, num_envs)"])
def test_who_reads_the_number_of_worlds_is_told_so(weight: str) -> None:
    program = gate.check(f"def f(dof_pos, num_envs):\n    return dof_pos[:, 0] * {weight}, {{}}\n", ANT)
    assert isinstance(program, gate.Program)
    states = recorded(ANT)
    (finding,) = examine.examine(probe.probe(load.load(program), ANT, states), ANT, states)
    assert finding.rule == "coupling" and finding.fix.endswith("use neither the number nor the order of worlds")


def test_closeness_is_that_of_torch_at_infinity_too() -> None:
    for options in ("", ", equal_nan=True"):
        call = f"torch.isclose(dof_pos[:, 0], dof_pos[:, 1]{options})"
        source = f"def compute_reward(dof_pos):\n    return {call}.float(), {{}}\n"
        compiled = graph.CompiledReward(accepted(CARTPOLE, source).graph, CARTPOLE)
        inf, nan = math.inf, math.nan
        pairs = torch.tensor([[1.0, inf], [inf, inf], [1.0, 1.0], [inf, 2.0], [-inf, inf], [nan, nan], [nan, 1.0]])
        expected = torch.isclose(pairs[:, 0], pairs[:, 1], equal_nan=bool(options)).float()
        assert torch.equal(compiled({"dof_pos": pairs})[0], expected)


@pytest.mark.parametrize("made", ["torch.as_tensor", "to_torch", "torch.tensor"])
def test_a_list_of_tensors_becomes_one(made: str) -> None:
    spec = StateSpec((*CARTPOLE.variables, StateVar(name="ends", meaning="ends", shape=(2,), kind="constant")))
    source = f"def compute_reward(dof_pos, ends):\n    return (dof_pos * {made}([ends[1], ends[0]])).sum(-1), {{}}\n"
    program = gate.check(source, spec)
    assert isinstance(program, gate.Program)
    states = {**recorded(CARTPOLE), "ends": torch.tensor([2.0, 3.0])}
    traced = probe.probe(load.load(program), spec, states)
    reward, _ = graph.CompiledReward(traced.graph, spec)(
        {"dof_pos": torch.tensor([[1.0, 10.0]]), "ends": states["ends"]}
    )
    assert float(reward) == 23.0
