"""Graphs as data: what one may contain, what is refused, and that a graph runs on any number of worlds."""

from __future__ import annotations

import json
from typing import Any

import pytest
import torch

from openeureka.codec import DecodeError, decode, encode
from openeureka.reward import examine, gate, graph, load, probe
from openeureka.reward.validate import validate
from openeureka.types import Finding, Node, RewardGraph, StateSpec, StateVar
from reward.honest import CARTPOLE, recorded


def cart_reward() -> RewardGraph:
    """-2 |x|, with |x| as a component. The last node, three ones per world, is needed by no output."""
    nodes = (
        Node("input", ("dof_pos",)),
        Node("select.int", ({"ref": 0}, 1, 0)),
        Node("abs.default", ({"ref": 1},)),
        Node("mul.Tensor", ({"ref": 2}, -2.0)),
        Node("ones.default", (({"n": 3},),)),
    )
    return RewardGraph(nodes=nodes, reward=3, components=(("distance", 2),))


def test_text_and_back_is_the_same_graph() -> None:
    made = cart_reward()
    validate(made)
    assert decode(RewardGraph, encode(made)) == made


def test_infinite_numbers_survive_as_strict_json_and_as_python() -> None:
    made = RewardGraph(
        nodes=(
            Node("input", ("dof_pos",)),
            Node("clamp.default", ({"ref": 0}, float("-inf"), 1.0)),
            Node("sum.dim_IntList", ({"ref": 1}, (1,))),
        ),
        reward=2,
        components=(),
    )
    text = encode(made)
    json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    validate(made)
    assert decode(RewardGraph, text) == made
    names: dict[str, Any] = {"torch": torch}
    exec(graph.spelled(made, CARTPOLE), names)  # nor is it Python
    assert names["reward"]({"dof_pos": torch.tensor([[-3.0, 5.0]])})[0].tolist() == [-2.0]


def test_a_compiled_graph_takes_any_number_of_worlds_and_leaves_its_inputs_alone() -> None:
    compiled = graph.CompiledReward(cart_reward(), CARTPOLE)
    for worlds in (1, 5, 300):
        states = {"dof_pos": torch.tensor([[-1.5, 9.0]]).repeat(worlds, 1)}
        reward, components = compiled(states)
        assert torch.equal(reward, torch.full((worlds,), -3.0))  # -2 * |-1.5|
        assert torch.equal(components["distance"], torch.full((worlds,), 1.5))
        reward.zero_()
        components["distance"].zero_()
        assert torch.equal(states["dof_pos"][:, 0], torch.full((worlds,), -1.5))


def test_a_component_that_is_an_input_is_a_copy() -> None:
    made = RewardGraph(nodes=(*cart_reward().nodes[:2],), reward=1, components=(("x", 1),))
    states = {"dof_pos": torch.ones(4, 2)}
    reward, components = graph.CompiledReward(made, CARTPOLE)(states)
    reward += 5
    components["x"] += 7
    assert torch.equal(states["dof_pos"], torch.ones(4, 2))


def test_simplify_keeps_what_outputs_need() -> None:
    small, origin = graph.simplify(cart_reward())
    assert [node.op for node in small.nodes] == ["input", "select.int", "abs.default", "mul.Tensor"]
    assert origin == (0, 1, 2, 3)


def test_the_interpreter_and_the_compiled_graph_agree() -> None:
    states = recorded(CARTPOLE)
    reward, _ = graph.CompiledReward(cart_reward(), CARTPOLE)(states)
    done = list(graph.values(cart_reward(), states, 256))
    assert torch.equal(reward, done[3])


def broken(**changes: Any) -> str:
    data = json.loads(encode(cart_reward()))
    data.update(changes)
    data["nodes"] = [node if isinstance(node, dict) else _node(*node) for node in data["nodes"]]
    return json.dumps(data)


def _node(op: Any, args: Any, kwargs: Any) -> dict[str, Any]:
    return {"op": op, "args": args, "kwargs": kwargs}


NODES = json.loads(encode(cart_reward()))["nodes"]
FORGED = {
    "not JSON": "{",
    "not an object": "[]",
    "another version": broken(version=2),
    "no nodes": broken(nodes=[]),
    "too many nodes": broken(nodes=[["input", ["dof_pos"], {}]] * 3000),
    "an operation off the list": broken(nodes=[*NODES, ["from_file.default", ["/etc/passwd"], {}]]),
    "an in-place operation": broken(nodes=[*NODES, ["add_.Tensor", [{"ref": 0}, {"ref": 0}], {}]]),
    "an operation with an out argument": broken(nodes=[*NODES, ["add.out", [{"ref": 0}, {"ref": 0}], {}]]),
    "a random operation": broken(nodes=[*NODES, ["rand.default", [[3]], {}]]),
    "a Python expression as an operation": broken(nodes=[*NODES, ["__class__.x", [], {}]]),
    "a reference forwards": broken(nodes=[["neg.default", [{"ref": 1}], {}], *NODES]),
    "a reference to itself": broken(nodes=[*NODES, ["neg.default", [{"ref": 5}], {}]]),
    "a negative reference": broken(nodes=[*NODES, ["neg.default", [{"ref": -1}], {}]]),
    "a true reference": broken(nodes=[*NODES, ["neg.default", [{"ref": True}], {}]]),
    "a huge multiple of the worlds": broken(nodes=[*NODES, ["ones.default", [[{"n": 10**9}]], {}]]),
    "an unknown argument form": broken(nodes=[*NODES, ["neg.default", [{"file": "x"}], {}]]),
    "a two-key argument": broken(nodes=[*NODES, ["neg.default", [{"ref": 0, "n": 1}], {}]]),
    "an unknown dtype": broken(nodes=[*NODES, ["ones.default", [[2]], {"dtype": "os"}]]),
    "a reward out of range": broken(reward=99),
    "a reward that is true": broken(reward=True),
    "a component name with markup": broken(components=[["</script>", 2]]),
    "components of one name": broken(components=[["a", 2], ["a", 2]]),
    "too many components": broken(components=[[f"c{i}", 2] for i in range(17)]),
    "a constant whose shape lies": broken(nodes=[*NODES, ["constant", [[1.0], [2, 2], "float32"], {}]]),
    "a constant of text": broken(nodes=[*NODES, ["constant", [["x"], [1], "float32"], {}]]),
    "a large constant": broken(nodes=[*NODES, ["constant", [[0.0] * 5000, [5000], "float32"], {}]]),
    "an input with two names": broken(nodes=[["input", ["dof_pos", "dof_vel"], {}], *NODES[1:]]),
    "deep nesting": '{"version": 1, "nodes": ' + "[" * 5000 + "]" * 5000 + "}",
}


@pytest.mark.parametrize("name", FORGED)
def test_a_forged_graph_is_refused(name: str) -> None:
    with pytest.raises((DecodeError, graph.GraphError)):
        graph.CompiledReward(decode(RewardGraph, FORGED[name]), CARTPOLE)


def test_an_input_off_the_table_is_refused() -> None:
    with pytest.raises(graph.GraphError, match="not a state variable"):
        graph.CompiledReward(RewardGraph(nodes=(Node("input", ("fitness",)),), reward=0, components=()), CARTPOLE)


BOMBS = {
    "a square of the worlds": (Node("zeros.default", (({"n": 1}, {"n": 1}),)),),
    "repeated growth": (
        Node("full.default", ((4096,), 1.0)),
        Node("unsqueeze.default", ({"ref": 1}, 1)),
        Node("mul.Tensor", ({"ref": 1}, {"ref": 2})),
        Node("unsqueeze.default", ({"ref": 3}, 2)),
        Node("mul.Tensor", ({"ref": 3}, {"ref": 4})),
    ),
}

WRONG_CALLS = {
    "a missing argument": Node("add.Tensor", ({"ref": 0},)),
    "text for a tensor": Node("neg.default", ("x",)),
    "an index out of range": Node("select.int", ({"ref": 0}, 1, 99)),
    "a part of a tensor that has no parts": Node("getitem", ({"ref": 0}, 9)),
    "a negative size": Node("zeros.default", ((-5,),)),
    "an unknown keyword": Node("neg.default", ({"ref": 0},), {"out": None}),
    "a size that nothing needs": Node("zeros.default", ((10**6, 10**6),)),
    "a dimension that no tensor has": Node("sum.dim_IntList", ({"ref": 0}, (99,))),
    "a dimension that is the number of worlds": Node("sum.dim_IntList", ({"ref": 0}, ({"n": 1},))),
    "a dtype that is a node": Node("ones.default", ((2,),), {"dtype": {"ref": 0}}),
    "a device": Node("ones.default", ((2,),), {"device": "cuda"}),
    "one argument too many": Node("neg.default", ({"ref": 0}, 1.0)),
    "one argument twice": Node("sum.dim_IntList", ({"ref": 0}, (1,)), {"dim": (1,)}),
    "strides of its own choice": Node("_reshape_alias.default", ({"ref": 0}, (100,), (10**6,))),
    "a number that is no size": Node("ones.default", ((2**62, 2**62),)),
}


@pytest.mark.parametrize("name", WRONG_CALLS)
def test_an_operation_called_wrongly_is_a_finding(name: str) -> None:
    nodes = (Node("input", ("dof_pos",)), WRONG_CALLS[name])
    traced = probe.Traced(
        RewardGraph(nodes=(*nodes, Node("select.int", ({"ref": 0}, 1, 0))), reward=2, components=()), ()
    )
    findings = examine.examine(traced, CARTPOLE, recorded(CARTPOLE))
    assert [finding.rule for finding in findings] == ["operation"]


@pytest.mark.parametrize("name", BOMBS)
def test_a_graph_that_asks_for_much_memory_is_refused_before_it_runs(name: str) -> None:
    nodes = (Node("input", ("dof_pos",)), *BOMBS[name], Node("select.int", ({"ref": 0}, 1, 0)))
    bomb = RewardGraph(nodes=nodes, reward=len(nodes) - 1, components=())
    findings = examine.examine(probe.Traced(bomb, ()), CARTPOLE, recorded(CARTPOLE))
    assert [finding.rule for finding in findings] == ["memory"]


def examined(*nodes: Node, worlds: int = 0) -> list[str]:
    """The rules that a graph of these nodes breaks. Its reward is the last node."""
    made = RewardGraph(nodes=(Node("input", ("dof_pos",)), *nodes), reward=len(nodes), components=())
    found = examine.examine(probe.Traced(made, ()), CARTPOLE, recorded(CARTPOLE), worlds)
    return [finding.rule for finding in found]


def test_a_shape_is_measured_with_the_worlds_that_train() -> None:
    """An outer product of the worlds from 20,000 on: empty in 512 worlds, above the limit per world in 40,000."""
    beyond = (
        Node("select.int", ({"ref": 0}, 1, 0)),
        Node("slice.Tensor", ({"ref": 1}, 0, 20_000, 2**63 - 1)),
        Node("unsqueeze.default", ({"ref": 2}, 1)),
        Node("mul.Tensor", ({"ref": 2}, {"ref": 3})),
        Node("sum.default", ({"ref": 4},)),
        Node("mul.Tensor", ({"ref": 5}, 0.0)),
        Node("add.Tensor", ({"ref": 1}, {"ref": 6})),
    )
    assert examined(*beyond, worlds=512) == []
    assert examined(*beyond, worlds=40_000) == ["memory"]


@pytest.mark.parametrize("first", [300, 500])
def test_worlds_that_depend_on_others_only_above_the_recorded_number_are_refused(first: int) -> None:
    nodes = (
        Node("select.int", ({"ref": 0}, 1, 0)),
        Node("slice.Tensor", ({"ref": 1}, 0, first, 2**63 - 1)),
        Node("sum.default", ({"ref": 2},)),
        Node("add.Tensor", ({"ref": 1}, {"ref": 3})),
    )
    assert examined(*nodes) == examined(*nodes, worlds=64) == examined(*nodes, worlds=1024) == ["coupling"]


def refused(source: str) -> tuple[Finding, ...]:
    """Findings about the graph of a program that the gate accepts."""
    program = gate.check(source, CARTPOLE)
    assert isinstance(program, gate.Program), program
    states = recorded(CARTPOLE)
    return examine.examine(probe.probe(load.load(program), CARTPOLE, states), CARTPOLE, states)


RARE = "x = obs_buf[:, 0]\n    rare = (x > 1e5).float()\n    "


@pytest.mark.parametrize(
    "found",
    [
        "torch.cumsum(rare, 0)[-1]",
        "rare.cumsum(dim=-1)",
        "torch.cumprod(1.0 + rare, 0)[-1]",
        "torch.cummax(rare, 0)[0][-1]",
        "torch.sort(rare, dim=0, descending=True)[0][0]",
        "torch.sort(rare).values[-1]",
        "torch.roll(rare, 1)",
        "torch.roll(rare, 1, 0)",
        "rare.flip(0)",
        "rare.topk(num_envs)[0][0]",
        "torch.softmax(rare, 0) * num_envs",
        "rare[:, None].expand(-1, 2).reshape(-1).cumsum(0)[-1]",
    ],
)
def test_a_scan_of_the_worlds_is_refused_though_it_gives_all_that_were_recorded_the_same(found: str) -> None:
    findings = refused(f"def f(obs_buf, num_envs):\n    {RARE}return x - {found}, {{}}\n")
    assert [(finding.rule, finding.line) for finding in findings] == [("coupling", 4)]


def test_a_scan_within_each_world_is_fine() -> None:
    parts = "obs_buf.cumsum(-1)[:, -1] + obs_buf.T.cumsum(0)[-1] + obs_buf.sort(dim=1)[0][:, 0] + obs_buf.flip(1)[:, 0]"
    assert refused(f"def f(obs_buf):\n    r = {parts} + obs_buf.roll(1, -1)[:, 0]\n    return r, {{}}\n") == ()


def test_a_reward_that_would_keep_a_training_waiting_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    select = Node("select.int", ({"ref": 0}, 1, 0))
    assert examined(select) == []
    monkeypatch.setattr(examine, "MAX_CALL_SECONDS", 0.0)
    assert examined(select) == ["slow"]


def test_a_compiled_graph_divides_no_integers_and_truncates() -> None:
    """Dividing the lowest int64 by -1 would end the process. Floats have no such case."""
    whole = Node("_to_copy.default", ({"ref": 1},), {"dtype": "int64"})
    for operands, rule in ((({"ref": 2}, {"ref": 2}), "integer"), (({"ref": 1}, {"ref": 2}), None)):
        divide = Node("div.Tensor_mode", operands, {"rounding_mode": "trunc"})
        nodes = (Node("input", ("dof_pos",)), Node("select.int", ({"ref": 0}, 1, 0)), whole, divide)
        compiled = graph.CompiledReward(RewardGraph(nodes=nodes, reward=3, components=()), CARTPOLE)
        states = {"dof_pos": torch.full((4, 2), 2.0)}
        if rule is None:
            assert compiled(states)[0].tolist() == [1.0] * 4
        else:
            with pytest.raises(RuntimeError, match=rule):
                compiled(states)


def test_a_forged_component_that_is_not_one_number_per_world_is_refused() -> None:
    """The probe writes the mean per world into the graph. A component of another shape would stop the trainer."""
    made = cart_reward()
    wide = RewardGraph(nodes=made.nodes, reward=made.reward, components=(("wide", 0),))
    findings = examine.examine(probe.Traced(wide, ()), CARTPOLE, recorded(CARTPOLE))
    assert [finding.rule for finding in findings] == ["components"]


@pytest.mark.parametrize(
    "value",
    [
        "q.flatten(1).sum(-1)",
        "q.reshape(num_envs, -1).norm(dim=-1)",
        "q.contiguous().view(num_envs, 6).sum(-1)",
        "q.reshape(-1, 3).norm(dim=-1).reshape(-1, 2).sum(-1)",
        "torch.einsum('nij,nij->n', q, q)",
        "(q @ torch.eye(3)).sum((1, 2))",
        "torch.matmul(q, torch.tensor([0.0, 0.0, 1.0])).sum(-1)",
    ],
)
def test_a_reshape_is_one_of_slices_too(value: str) -> None:
    """Tracing sees contiguous tensors and records a reshape as a view, which fails on the slices that tasks pass."""
    worlds = StateVar(name="num_envs", meaning="worlds", kind="num_envs")
    spec = StateSpec((StateVar(name="q", shape=(2, 3), meaning="points"), worlds))
    program = gate.check(f"def compute_reward(q, num_envs):\n    return {value}, {{}}\n", spec)
    assert isinstance(program, gate.Program)
    traced = probe.probe(load.load(program), spec, {"q": torch.randn(64, 2, 3), "num_envs": 64}).graph
    part = torch.randn(5, 2, 9)[..., 3:6]
    expected = eval(value, {"q": part.contiguous(), "num_envs": 5, "torch": torch})
    torch.testing.assert_close(graph.CompiledReward(traced, spec)({"q": part})[0], expected)
    (*_, last) = graph.values(traced, {"q": part}, 5)
    torch.testing.assert_close(last, expected)
    names: dict[str, Any] = {"torch": torch}
    exec(graph.spelled(traced, spec), names)
    torch.testing.assert_close(names["reward"]({"q": part})[0], expected)


def test_a_constant_keeps_the_type_in_which_it_was_written():
    nodes = (Node("constant", ((1, 2), (2,), "int32")), Node("constant", ((0.1,), (), "float64")))
    whole, exact = graph.values(RewardGraph(nodes=nodes, reward=1, components=()), {}, 1)
    assert (whole.tolist(), whole.dtype) == ([1, 2], torch.int32)
    assert (exact.item(), exact.dtype) == (0.1, torch.float64)  # in 32 bits it would be 0.10000000149
