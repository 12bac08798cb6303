"""Programs of the same form count as the same reward."""

from __future__ import annotations

import itertools

import pytest
import torch

from openeureka.reward import form as forms
from openeureka.reward import gate, graph, load, probe
from openeureka.reward.form import form
from openeureka.reward.validate import validate
from openeureka.types import Node, RewardGraph
from reward.honest import CARTPOLE, recorded

HEAD = "def compute_reward(dof_pos, dof_vel):\n    x, v = dof_pos[:, 0], dof_vel[:, 0]\n"
SAME = {
    "one after the other": "a = torch.exp(-x.abs() / 0.1) * 2; b = 0.01 * v**2; return a - b, {'a': a, 'b': b}",
    "the other way round": "b = -0.01 * v**2; a = 2.0 * torch.exp(-x.abs() * 10); return b + a, {'b': b, 'a': a}",
    "begun with zeros": "r = torch.zeros_like(x); r += torch.exp(-10 * x.abs()) * 2; r -= v**2 / 100; return r, {}",
    "less what is left of one": "a = 1 - torch.exp(-10 * x.abs()); return 2 * (1 - a) - 0.01 * v**2, {}",
    "in halves": "half = torch.exp(x.abs() / -0.1) - 0.005 * v**2; return half + half, {'unused': half * x}",
}
OTHER = {
    "another weight": "return 2 * torch.exp(-x.abs() / 0.1) - 0.02 * v**2, {}",
    "another sign": "return 2 * torch.exp(-x.abs() / 0.1) + 0.01 * v**2, {}",
    "a constant more": "return 2 * torch.exp(-x.abs() / 0.1) - 0.01 * v**2 + 1, {}",
    "another scale inside": "return 2 * torch.exp(-x.abs() / 0.2) - 0.01 * v**2, {}",
    "another variable": "return 2 * torch.exp(-v.abs() / 0.1) - 0.01 * v**2, {}",
    "a term twice": "a = 2 * torch.exp(-x.abs() / 0.1)\n    return a + a - 0.01 * v**2, {}",
    "a product of the terms": "return 2 * torch.exp(-x.abs() / 0.1) * (-0.01 * v**2), {}",
    "only one of them": "return 2 * torch.exp(-x.abs() / 0.1), {}",
}


@pytest.fixture(scope="module")
def graphs() -> dict[str, RewardGraph]:
    found = {}
    for name, body in (SAME | OTHER).items():
        program = gate.check(f"import torch\n\n{HEAD}    {body}\n", CARTPOLE)
        assert isinstance(program, gate.Program), (name, program)
        found[name] = probe.probe(load.load(program), CARTPOLE, recorded(CARTPOLE)).graph
    return found


def test_order_spelling_and_names_make_no_other_reward(graphs: dict[str, RewardGraph]) -> None:
    assert len({form(graphs[name]) for name in SAME}) == 1
    paid = [graph.CompiledReward(graphs[name], CARTPOLE)(recorded(CARTPOLE))[0] for name in SAME]
    for own, other in itertools.pairwise(paid):
        torch.testing.assert_close(own, other)


def test_what_pays_otherwise_has_another_form(graphs: dict[str, RewardGraph]) -> None:
    names = ["one after the other", *OTHER]
    assert len({form(graphs[name]) for name in names}) == len(names)


def test_a_sum_that_doubles_itself_is_cheap() -> None:
    start = [Node("input", ("dof_pos",)), Node("select.int", ({"ref": 0}, 1, 0))]
    doubled = [Node("add.Tensor", ({"ref": index}, {"ref": index})) for index in range(1, 1900)]
    assert form(RewardGraph(nodes=(*start, *doubled), reward=1900, components=()))


def test_a_sum_is_spelled_once_whoever_refers_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    spelled: list[dict[str, float]] = []
    of = forms._digest
    monkeypatch.setattr(forms, "_digest", lambda terms: spelled.append(terms) or of(terms))
    stacked = Node("stack.default", (({"ref": 1},) * 1000, 0))
    nodes = (Node("input", ("dof_pos",)), Node("select.int", ({"ref": 0}, 1, 0)), stacked)
    assert form(RewardGraph(nodes=nodes, reward=2, components=()))
    assert len(spelled) == 3


def test_the_number_of_worlds_is_a_term_like_another() -> None:
    nodes = (
        Node("input", ("dof_pos",)),
        Node("select.int", ({"ref": 0}, 1, 0)),
        Node("add.Tensor", ({"ref": 1}, {"n": 1})),
    )
    counted, plain = (RewardGraph(nodes=nodes, reward=index, components=()) for index in (2, 1))
    assert form(counted) != form(plain)


def test_what_a_bonus_pays_for_makes_another_reward() -> None:
    nodes = (Node("input", ("dist",)), Node("input", ("height",)), Node("neg.default", ({"ref": 0},)))
    done, high, none = (
        RewardGraph(nodes=nodes, reward=2, components=components)
        for components in ((("progress_done", 0),), (("progress_done", 1),), (("done", 0),))
    )
    assert len({form(done), form(high), form(none)}) == 3


REF, LATER = {"ref": 1}, {"ref": 2}


@pytest.mark.parametrize(
    "node",
    [
        Node("neg.default", (), {"self": REF}),
        Node("add.Scalar", (REF, 1.0, 2.0)),
        Node("add.Tensor", (REF,), {"other": LATER}),
        Node("sub.Tensor", (REF,), {"other": 2.0}),
        Node("rsub.Scalar", (), {"self": REF, "other": 1.0}),
        Node("rsub.Scalar", (REF, 1.0, 2.0)),
        Node("mul.Tensor", (), {"self": REF, "other": 2.0}),
        Node("div.Tensor_mode", (REF, 2.0), {"rounding_mode": "floor"}),
    ],
    ids=lambda node: f"{node.op} {len(node.args)}",
)
def test_arguments_in_any_order_that_may_train_have_a_form(node: Node) -> None:
    start = (Node("input", ("dof_pos",)), Node("select.int", ({"ref": 0}, 1, 0)), Node("abs.default", (REF,)))
    whole, part = (RewardGraph(nodes=(*start, node), reward=index, components=()) for index in (3, 1))
    validate(whole)
    assert form(whole) != form(part)


def test_a_difference_either_way_round_is_one_sum() -> None:
    start = (Node("input", ("dof_pos",)), Node("select.int", ({"ref": 0}, 1, 0)))
    # 3 - 2 x
    spelled = (
        (Node("rsub.Scalar", (REF, 3.0), {"alpha": 2}),),
        (Node("mul.Tensor", (REF, -2.0)), Node("add.Tensor", (LATER, 3.0))),
    )
    other = (Node("sub.Scalar", (REF, 3.0), {"alpha": 2}),)  # x - 2 * 3
    forms = [
        form(RewardGraph(nodes=(*start, *nodes), reward=1 + len(nodes), components=())) for nodes in (*spelled, other)
    ]
    assert forms[0] == forms[1] != forms[2]
