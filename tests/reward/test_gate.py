"""What the gate says to the author of a program: line, rule and fix, word for word."""

from __future__ import annotations

import math
import sys
import time
from typing import Any

import pytest

from openeureka.reward import gate
from openeureka.testing.hostile import STATE
from openeureka.types import StateSpec, StateVar
from reward.honest import ANT, CARTPOLE


def sentences(source: str, state=CARTPOLE) -> list[str]:
    checked = gate.check(source, state)
    assert isinstance(checked, tuple), "accepted"
    return [finding.sentence() for finding in checked]


GOLDEN = {
    "an unknown input names the nearest state variable": (
        "def compute_reward(dof_poss):\n    return dof_poss[:, 0], {}\n",
        "line 1: `dof_poss` is not a state variable of this task [unknown-input]; "
        "did you mean `dof_pos`? inputs are obs_buf, dof_pos, dof_vel, num_envs",
    ),
    "an attribute of self that the task does not offer": (
        "def compute_reward(self):\n    return self.dof_velocity[:, 0], {}\n",
        "line 2: `dof_velocity` is not a state variable of this task [unknown-input]; "
        "did you mean `dof_vel`? inputs are obs_buf, dof_pos, dof_vel, num_envs",
    ),
    "a name that nothing defines": (
        "def compute_reward(dof_pos):\n    angle = dof_pos[:, 1]\n    return anglee, {}\n",
        "line 3: `anglee` is not defined [unknown-name]; did you mean `angle`?",
    ),
    "an in-place edit of an input": (
        "\n\ndef compute_reward(dof_pos):\n    dof_pos += 1\n    return dof_pos[:, 0], {}\n",
        "line 4: in-place `+=` on input `dof_pos` [input-edit]; write `dof_pos = dof_pos + 1`",
    ),
    "an assignment into an input": (
        "def compute_reward(dof_pos):\n    dof_pos[:, 0] = 1\n    return dof_pos[:, 0], {}\n",
        "line 2: assignment into input `dof_pos` [input-edit]; copy it first: `dof_pos = dof_pos.clone()`",
    ),
    "an in-place method on an input of self": (
        "def compute_reward(self):\n    self.dof_pos.clamp_(0, 1)\n    return self.dof_pos[:, 0], {}\n",
        "line 2: in-place `.clamp_` on input `self.dof_pos` [input-edit]; use `.clamp` and keep the result",
    ),
    "randomness": (
        "import torch\ndef compute_reward(dof_pos):\n    return torch.rand_like(dof_pos[:, 0]), {}\n",
        "line 3: `torch.rand_like` is random, and a reward must give the same value for the same state "
        "[randomness]; remove it",
    ),
    "a torch function off the list names the nearest": (
        "def compute_reward(dof_pos):\n    return torch.normm(dof_pos, dim=-1), {}\n",
        "line 2: `torch.normm` is not available to a reward [torch-function]; did you mean `norm`?",
    ),
    "a torch function that no graph can hold": (
        "def compute_reward(dof_pos):\n    return torch.vdot(dof_pos[:, 0], dof_pos[:, 1]), {}\n",
        "line 2: `torch.vdot` is not available to a reward [torch-function]; use `torch.dot`",
    ),
    "a function that is torch's in another place": (
        "def compute_reward(dof_pos):\n    return torch.special.logit(dof_pos)[:, 0], {}\n",
        "line 2: `torch.special.logit` is not available to a reward [torch-function]; use `torch.logit`",
    ),
    "a function in place": (
        "def compute_reward(dof_pos):\n    return torch.relu_(dof_pos)[:, 0], {}\n",
        "line 2: `torch.relu_` is not available to a reward [torch-function]; use `torch.relu`",
    ),
    "a value of the step before": (
        "def compute_reward(dof_pos, prev_dof_pos):\n    return (dof_pos - prev_dof_pos)[:, 0], {}\n",
        "line 1: `prev_dof_pos` is not a state variable of this task [unknown-input]; values of earlier steps are not "
        "available; the inputs are obs_buf, dof_pos, dof_vel, num_envs",
    ),
    "a value of the step before, as a free name": (
        "def compute_reward(dof_pos):\n    return (dof_pos - last_dof_pos)[:, 0], {}\n",
        "line 2: `last_dof_pos` is not defined [unknown-name]; values of earlier steps are not available",
    ),
    "a value read out of a tensor": (
        "def compute_reward(dof_pos):\n    return dof_pos[:, 0] * dof_pos.max().item(), {}\n",
        "line 2: `.item` turns tensor values into Python values [data-read]; stay with tensors of one value per world",
    ),
    "an import": (
        "import scipy\ndef compute_reward(dof_pos):\n    return dof_pos[:, 0], {}\n",
        "line 1: `scipy` cannot be imported [import]; torch, math, typing and `np.pi` are there; "
        "helpers such as `quat_mul` need no import",
    ),
    "a power that would fill the memory, outside the function": (
        "BIG = 10 ** 10 ** 8\ndef compute_reward(dof_pos):\n    return dof_pos[:, 0], {}\n",
        "line 1: only imports, functions and literal constants may stand outside a function [statement]; "
        "move it into the reward function or remove it",
    ),
    "an import inside the function": (
        "def compute_reward(dof_pos):\n    import os\n    return dof_pos[:, 0], {}\n",
        "line 2: `os` cannot be imported [import]; torch, math, typing and `np.pi` are there; "
        "helpers such as `quat_mul` need no import",
    ),
    "a random helper": (
        "from isaacgym.torch_utils import torch_rand_float\ndef compute_reward(dof_pos):\n"
        "    return torch_rand_float(0, 1, (3, 1), 'cpu'), {}\n",
        "line 3: `torch_rand_float` is random, and a reward must give the same value for the same state "
        "[randomness]; remove it",
    ),
    "a while loop": (
        "def compute_reward(dof_pos):\n    while True:\n        pass\n    return dof_pos[:, 0], {}\n",
        "line 2: `while` is not allowed [statement]; use tensor operations, or `for` over a small `range`",
    ),
    "a statement that parses but cannot be compiled": (
        "def compute_reward(dof_pos):\n    break\n    return dof_pos[:, 0], {}\n",
        "line 2: Python cannot read it: 'break' outside loop [syntax]",
    ),
    "a class around the function": (
        "class Reward:\n    def compute_reward(self):\n        return self.dof_pos[:, 0], {}\n",
        "line 1: `class` is not allowed [statement]; write plain functions",
    ),
    "a class beside the function": (
        "class Scales:\n    a = 1.0\ndef compute_reward(dof_pos):\n    return Scales.a * dof_pos[:, 0], {}\n",
        "line 1: `class` is not allowed [statement]; write plain functions",
    ),
    "a set": (
        "def compute_reward(dof_pos):\n    names = {'a'}\n    return dof_pos[:, 0], {}\n",
        "line 2: a set is not allowed [statement]; write a list or a tuple",
    ),
    "a name of the function around": (
        "def f(dof_pos):\n    r = 0\n    def g():\n        nonlocal r\n    return dof_pos[:, 0], {}\n",
        "line 4: `nonlocal` is not allowed [statement]; pass the value as an argument, and return the new one",
    ),
    "a block that chooses a precision": (
        "def f(dof_pos):\n    with torch.cuda.amp.autocast():\n        r = dof_pos[:, 0]\n    return r, {}\n",
        "line 2: `with` is not allowed [statement]; keep its body, remove the line",
    ),
    "a method that no tensor here has": (
        "def f(dof_pos):\n    return dof_pos.scatter(1, dof_pos.long(), 1.0)[:, 0], {}\n",
        "line 2: `.scatter` is not an allowed attribute [attribute]; write it with other operations",
    ),
    "a device that is chosen inside the function": (
        "def f(dof_pos):\n    device = 'cuda' if torch.cuda.is_available() else 'cpu'\n    return dof_pos[:, 0], {}\n",
        "line 2: `torch.cuda.is_available` is not available to a reward [torch-function]; "
        "leave it out: a reward runs where its inputs are",
    ),
    "a device that is chosen above the function": (
        "import torch\ndevice = torch.device('cuda' if torch.cuda.is_available() else 'cpu')\n"
        "def f(dof_pos):\n    return dof_pos[:, 0], {}\n",
        "line 2: only imports, functions and literal constants may stand outside a function [statement]; "
        "leave it out: a reward runs where its inputs are",
    ),
    "an edit of an input by a sign": (
        "def f(dof_pos):\n    dof_pos |= dof_vel\n    return dof_pos[:, 0], {}\n",
        "line 2: in-place `|=` on input `dof_pos` [input-edit]; write `dof_pos = dof_pos | dof_vel`",
    ),
    "a name of typing as a value": (
        "from typing import Any\ndef f(dof_pos):\n    return dof_pos[:, 0] * isinstance(dof_pos, Any), {}\n",
        "line 3: `typing.Any` is not available to a reward [unknown-name]; "
        "use it in annotations alone, and write `{}` for a dict",
    ),
    "a name of collections as a value": (
        "from collections import OrderedDict\ndef f(dof_pos):\n    return dof_pos[:, 0], OrderedDict()\n",
        "line 3: `collections.OrderedDict` is not available to a reward [unknown-name]; "
        "use it in annotations alone, and write `{}` for a dict",
    ),
    "a method that is a function only": (
        "def f(dof_pos):\n    return dof_pos[:, 0].isclose(dof_pos[:, 1]).float(), {}\n",
        "line 2: `.isclose` is not an allowed attribute [attribute]; use `torch.isclose`",
    ),
    "a guess that would lead astray": (
        "def compute_reward(dof_pos):\n    return open(dof_pos), {}\n",
        "line 2: `open` is not defined [unknown-name]; define it or remove it",
    ),
    "a syntax error": (
        "def compute_reward(dof_pos):\n    return dof_pos[:, 0\n",
        "line 2: Python cannot read it: '[' was never closed [syntax]",
    ),
}


_TYPE_PARAMETER = "a type parameter such as `[T]` is not allowed [statement]; remove it"
NEWER = {
    "def compute_reward[T: print(1)](pos):\n    return pos[:, 0], {}\n": (12, f"line 1: {_TYPE_PARAMETER}"),
    "def compute_reward[*T](pos):\n    return pos[:, 0], {}\n": (12, f"line 1: {_TYPE_PARAMETER}"),
    "def compute_reward[**T](pos):\n    return pos[:, 0], {}\n": (12, f"line 1: {_TYPE_PARAMETER}"),
    "def compute_reward[T = print(1)](pos):\n    return pos[:, 0], {}\n": (13, f"line 1: {_TYPE_PARAMETER}"),
    "def compute_reward(pos):\n    type X = print(1)\n    return pos[:, 0], {}\n": (
        12,
        "line 2: `type` is not allowed [statement]; remove the line",
    ),
    "def compute_reward(pos):\n    x = t'{pos}'\n    return pos[:, 0], {}\n": (
        14,
        "line 2: a t-string is not allowed [statement]; use an f-string",
    ),
    "def compute_reward(pos):\n    x = f'{f'{pos.__class__}'}'\n    return pos[:, 0], {}\n": (
        12,
        "line 2: `__class__` is not allowed [dunder]; remove it",
    ),
}
"""Programs that Python 3.11 cannot read, with the minor version that can, and what is said there."""


@pytest.mark.parametrize("source", NEWER)
def test_syntax_that_python_gained_since_3_11_opens_nothing(source: str) -> None:
    minor, said = NEWER[source]
    first = sentences(source, STATE)[0]
    assert first == said if sys.version_info >= (3, minor) else first.endswith("[syntax]")


@pytest.mark.parametrize("name", GOLDEN)
def test_a_refusal_names_line_rule_and_fix(name: str) -> None:
    source, expected = GOLDEN[name]
    assert sentences(source)[0] == expected


@pytest.mark.parametrize(
    "source",
    [
        "KEPT = {'n': 0}\ndef f(dof_pos):\n    KEPT['n'] += 1\n    return dof_pos[:, 0], {}\n",
        "KEPT = {}\ndef f(dof_pos):\n    KEPT['before'] = dof_pos\n    return dof_pos[:, 0], {}\n",
        "KEPT = []\ndef f(dof_pos):\n    KEPT.append(1)\n    return dof_pos[:, 0], {}\n",
        "def f(dof_pos, KEPT={'n': 0}):\n    KEPT['n'] = 1\n    return dof_pos[:, 0], {}\n",
        "def f(dof_pos, *, KEPT=[0]):\n    KEPT[0] += 1\n    return dof_pos[:, 0], {}\n",
    ],
)
def test_what_would_remember_is_refused(source: str) -> None:
    (sentence,) = sentences(source)
    assert "`KEPT` would keep a value from one call to the next [state]" in sentence


def test_what_is_made_anew_in_each_call_may_be_changed() -> None:
    source = "PARTS = {'a': 1.0}\ndef f(dof_pos):\n    PARTS = {}\n    PARTS['a'] = dof_pos[:, 0]\n"
    source += "    rest = []\n    rest.append(PARTS['a'])\n    return rest[0], PARTS\n"
    assert isinstance(gate.check(source, CARTPOLE), gate.Program)


@pytest.mark.parametrize(
    ("call", "meant"),
    [
        ("quat_inv(dof_pos)", "quat_conjugate"),
        ("quat_inverse(dof_pos)", "quat_conjugate"),
        ("quat_to_euler(dof_pos)", "get_euler_xyz"),
        ("quat_rotate_vector(dof_pos, dof_vel)", "quat_rotate"),
        ("torch.special.expit(dof_pos)", "torch.sigmoid"),
        ("torch.special.xlogy(dof_pos, dof_vel)", "torch.xlogy"),
        ("torch.linalg.matmul(dof_pos, dof_vel)", "torch.matmul"),
        ("F.logit(dof_pos)", "torch.logit"),
        ("torch.softplus(dof_pos)", "torch.nn.functional.softplus"),
        ("torch.ger(dof_pos, dof_vel)", "torch.outer"),
        ("torch.arctanh(dof_pos)", "torch.atanh"),
        ("dof_pos.softplus()", "torch.nn.functional.softplus"),
    ],
)
def test_a_function_of_another_name_is_named(call: str, meant: str) -> None:
    (sentence,) = sentences(f"def f(dof_pos, dof_vel):\n    return {call}[:, 0], {{}}\n")
    assert sentence.endswith(f"use `{meant}`")


@pytest.mark.parametrize("dtype", ["float32", "float64", "int32"])
def test_a_dtype_that_is_no_method_is_written_as_an_argument(dtype: str) -> None:
    (sentence,) = sentences(f"def f(dof_pos):\n    return dof_pos.{dtype}()[:, 0], {{}}\n")
    assert sentence.endswith(f"write `.to(torch.{dtype})`")


@pytest.mark.parametrize(
    "call", ["torch.angle(dof_pos)", "torch.isin(dof_pos)", "torch.dsplit(dof_pos)", "print(dof_pos)"]
)
def test_no_function_is_guessed_that_does_something_else(call: str) -> None:
    (sentence,) = sentences(f"def f(dof_pos):\n    return {call}[:, 0], {{}}\n")
    assert "did you mean" not in sentence and "use `" not in sentence


@pytest.mark.parametrize(
    ("name", "guessed"),
    [
        ("gripper_position", "gripper_pos"),
        ("ball_velocities", "ball_velocity"),
        ("actions", ""),  # prev_actions is of the step before
        ("contact_force", ""),  # contact_force_scale is a factor, not a force
        ("goal2", ""),
        ("left_hand", ""),
    ],
)
def test_a_state_variable_is_guessed_that_is_the_same_in_other_words(name: str, guessed: str) -> None:
    names = ("gripper_pos", "ball_velocity", "prev_actions", "contact_force_scale", "goal1", "right_hand")
    spec = StateSpec(tuple(StateVar(name=known, meaning="", shape=()) for known in names))
    (sentence,) = sentences(f"def f({name}):\n    return {name}, {{}}\n", spec)
    assert (f"did you mean `{guessed}`?" in sentence) if guessed else ("did you mean" not in sentence)


def test_a_guess_that_would_change_the_reward_is_not_made() -> None:
    (sentence,) = sentences("def f(dof_pos):\n    return dof_pos.data[:, 0], {}\n")
    assert sentence.endswith("leave it out, the tensor itself is what it gives")


@pytest.mark.parametrize("call", ["F.relu(dof_pos, inplace=False)", "torch.exp(dof_pos, out=None)"])
def test_a_word_that_asks_for_no_edit_is_none(call: str) -> None:
    assert isinstance(gate.check(f"def f(dof_pos):\n    return {call}[:, 0], {{}}\n", CARTPOLE), gate.Program)


def test_every_reason_is_given_in_the_order_of_lines() -> None:
    source = "def f(dof_pos, goal):\n    dof_pos -= 1\n    open('x')\n    return torch.rand(3), {}\n"
    rules = [finding.rule for finding in gate.check(source, CARTPOLE)]  # type: ignore[union-attr]
    assert rules == ["unknown-input", "input-edit", "unknown-name", "randomness"]


def test_a_program_without_a_function_says_so() -> None:
    assert sentences("x = 1\n") == ["the program defines no function [no-function]; define `def compute_reward(...)`"]


def test_prose_is_no_program() -> None:
    assert [finding.rule for finding in gate.check("x = f(1)\ny", CARTPOLE)] == ["no-function"]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "example",
    [
        "import torch\nreward, _ = f(torch.rand(3, 2))\nprint(reward)\n",
        "with torch.no_grad():\n    reward, _ = f(torch.rand(3, 2))\nassert reward.shape == (3,)\n",
        "try:\n    f(1)\nexcept TypeError:\n    pass\n",
    ],
)
def test_an_example_of_use_below_the_function_is_ignored(example: str) -> None:
    source = f"def f(dof_pos):\n    return dof_pos[:, 0], {{}}\n{example}"
    assert isinstance(gate.check(source, CARTPOLE), gate.Program)


def test_an_example_of_use_sets_no_state_variable() -> None:
    source = "def f(potentials):\n    return potentials * dt * SCALE, {}\nSCALE = 2.0\ndt = 0.5\nnum_envs: int = 4\n"
    program = gate.check(source, ANT)
    assert isinstance(program, gate.Program)
    assert set(program.inputs) == {"potentials", "dt"} and program.draft.constants == {"SCALE"}


def test_a_list_of_constants_may_be_a_repeated_one() -> None:
    source = "W = [0.1] * 3\nPAIRS = 2 * (0.5, -1)\nGRID = [[0.0] * 2] * 2\nNONE = [1] * -1\n"
    program = gate.check(f"{source}def f(dof_pos):\n    return dof_pos[:, 0] * W[0], {{}}\n", CARTPOLE)
    assert isinstance(program, gate.Program)
    names: dict[str, Any] = {}
    exec(program.code(), names)
    assert (names["W"], names["PAIRS"]) == ([0.1, 0.1, 0.1], (0.5, -1, 0.5, -1))
    assert (names["GRID"], names["NONE"]) == ([[0.0, 0.0], [0.0, 0.0]], [])


@pytest.mark.parametrize(
    "long", ["[0] * 101", "[0] * 10 ** 9", "[[0] * 100] * 100", "[[]] * 101", "[([], ())] * 51", "[x] * 2", "[0] * 2.0"]
)
def test_a_repeated_list_that_is_long_or_odd_is_refused(long: str) -> None:
    (sentence,) = sentences(f"LONG = {long}\ndef f(dof_pos):\n    return dof_pos[:, 0] * LONG[0], {{}}\n")
    assert "[statement]" in sentence


def test_a_long_list_below_the_last_function_is_not_made() -> None:
    program = gate.check("def f(dof_pos):\n    return dof_pos[:, 0], {}\nLONG = [[]] * 101\n", CARTPOLE)
    assert isinstance(program, gate.Program) and not program.draft.constants


@pytest.mark.parametrize(
    ("source", "rule"),
    [
        ("W = torch.tensor([1.0])\ndef f(dof_pos):\n    return dof_pos[:, 0] * W.sum() * W, {}\n", "statement"),
        ("g = lambda x: x\ndef f(dof_pos):\n    return g(dof_pos[:, 0]), {}\n", "statement"),
        ("class A:\n    b = 1.0\ndef f(dof_pos):\n    return A.b * dof_pos[:, 0], {}\n", "statement"),
        ("import scipy\ndef f(dof_pos):\n    return scipy.special.expit(dof_pos)[:, 0], {}\n", "import"),
        ("def t(*x):\n    return sum(x)\ndef f(dof_pos):\n    return t(dof_pos[:, 0]), {}\n", "signature"),
    ],
)
def test_what_is_refused_where_it_is_made_is_not_refused_again_where_it_is_used(source: str, rule: str) -> None:
    found = gate.check(source, CARTPOLE)
    assert isinstance(found, tuple) and [finding.rule for finding in found] == [rule]


@pytest.mark.parametrize(
    ("call", "fix"),
    [
        ("np.float32(0.5)", "write the number itself, or `torch.float32` for a dtype"),
        ("math.prod([0.5, 2.0])", "multiply the numbers with `*`"),
        ("np.clip(1.5, 0, 1)", "use `torch.clip`"),
        ("np.array([0.5])", "use `torch.tensor`"),
        ("np.concatenate([dof_pos, dof_pos])", "use `torch.concatenate`"),
    ],
)
def test_what_is_said_of_functions_of_plain_numbers_works(call: str, fix: str) -> None:
    (sentence,) = sentences(f"def f(dof_pos):\n    return dof_pos[:, 0] * {call}, {{}}\n")
    assert sentence.endswith(fix)


def test_a_constant_may_be_made_of_those_above_it() -> None:
    source = (
        "import math\nFULL = 2.0 * math.pi\nHALF: float = -FULL / 2\nBOTH = [-FULL, HALF]\n"
        "def f(dof_pos, width=HALF):\n    return dof_pos[:, 0] * BOTH[0] + width, {}\n"
    )
    program = gate.check(source, CARTPOLE)
    assert isinstance(program, gate.Program)
    names: dict[str, Any] = {}
    exec(program.code(), names)
    assert names["BOTH"] == [-2.0 * math.pi, -math.pi]
    assert names["f"].__defaults__ == (-math.pi,)


@pytest.mark.parametrize(
    "line",
    ["A, B = 0.1", "A, B = 0.1, 0.2, 0.3", "A, *B = 0.1, 0.2", "A = B[0] = 0.1", "A = float('x')"],
)
def test_what_gives_no_name_a_number_is_refused_outside_a_function(line: str) -> None:
    assert "[statement]" in sentences(f"{line}\ndef f(dof_pos):\n    return dof_pos[:, 0], {{}}\n")[0]


def test_constants_that_would_fill_the_memory_are_refused_at_once() -> None:
    squares = "".join(f"X{i + 1} = X{i} * X{i}\n" for i in range(60))
    assert "statement" in sentences(f"X0 = 10\n{squares}def f(dof_pos):\n    return dof_pos[:, 0], {{}}\n")[0]


def test_a_decorator_may_be_imported_by_its_name() -> None:
    source = (
        "from torch import no_grad\nfrom torch.jit import script as jitted\n@jitted\ndef f(dof_pos):\n"
        "    with no_grad():\n        return dof_pos[:, 0], {}\n"
    )
    assert isinstance(gate.check(source, CARTPOLE), gate.Program)


def test_code_above_a_function_is_refused() -> None:
    assert sentences("x = f(1)\ndef f(dof_pos):\n    return dof_pos[:, 0], {}\n") == [
        "line 1: only imports, functions and literal constants may stand outside a function [statement]; "
        "move it into the reward function or remove it"
    ]


def test_inputs_are_arguments_free_names_and_attributes_of_self() -> None:
    program = gate.check("def f(dof_pos):\n    return dof_pos[:, 0] + dof_vel[:, 0], {}\n", CARTPOLE)
    assert isinstance(program, gate.Program)
    assert (program.inputs, program.arguments) == (("dof_pos", "dof_vel"), ("dof_pos",))
    method = gate.check("def f(self):\n    return self.dof_vel[:, 0] * self.num_envs, {}\n", CARTPOLE)
    assert isinstance(method, gate.Program)
    assert (set(method.inputs), method.arguments, method.draft.method) == ({"dof_vel", "num_envs"}, (), True)


def test_a_local_variable_may_have_the_name_of_a_state_variable() -> None:
    source = "def f(root_states):\n    targets = root_states[:, :3]\n    return targets.sum(-1), {}\n"
    program = gate.check(source, ANT)
    assert isinstance(program, gate.Program) and program.inputs == ("root_states",)


def test_a_python_number_may_be_changed_in_place() -> None:
    source = "def f(potentials, dt):\n    dt *= 2\n    return potentials * dt, {}\n"
    assert isinstance(gate.check(source, ANT), gate.Program)


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_line_ends_and_tabs_of_any_system_are_read(newline: str) -> None:
    source = newline.join(["def f(dof_pos):", "\tr = dof_pos[:, 0]", "\treturn r, {}", ""])
    assert isinstance(gate.check(source, CARTPOLE), gate.Program)


ODD = {
    "an empty index": "r = pos[()].sum(dim=-1)",
    "an integer of thousands of digits": "pos += 0x" + "F" * 6000,
    "one in an index": "r = pos[0x" + "F" * 6000 + "]",
    "one in a default": "f = lambda x=0x" + "F" * 6000 + ": x",
    "one that is assigned": "self.x = 0x" + "F" * 6000,
}


@pytest.mark.parametrize("name", ODD)
def test_an_odd_program_is_judged_like_any_other(name: str) -> None:
    source = f"def f(pos):\n    r = pos[:, 0]\n    {ODD[name]}\n    return r, {{}}\n"
    found = gate.check(source, STATE)
    assert isinstance(found, gate.Program) or all(finding.rule != "unreadable" for finding in found)
    assert isinstance(found, gate.Program) == (name == "an empty index")


def test_whatever_the_gate_trips_over_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def trip(tree: object) -> None:
        raise AttributeError("\x1b no such\nthing")

    monkeypatch.setattr(gate, "Rules", lambda *_: trip(None))
    (finding,) = gate.check("def f(pos):\n    return pos[:, 0], {}\n", STATE)  # type: ignore[misc]
    assert finding.rule == "unreadable" and finding.sentence().isprintable()


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("import torch as __builtins__\ndef f(pos):\n    return pos[:, 0], {}\n", "dunder"),
        ("def f(pos):\n    h = lambda open: 0\n    open('x')\n    return pos[:, 0], {}\n", "unknown-name"),
        ("def f(pos):\n    h = lambda x, open=open: open(x)\n    return pos[:, 0], {}\n", "unknown-name"),
        ("def f(pos):\n    h = [0 for open in (1, 2)]\n    open('x')\n    return pos[:, 0], {}\n", "unknown-name"),
        (
            "def f(pos):\n    def g(open):\n        return open\n    return pos[:, 0] + open('x'), {}\n",
            "unknown-name",
        ),
    ],
)
def test_a_name_is_known_where_it_is_bound_and_nowhere_else(text: str, rule: str) -> None:
    found = gate.check(text, STATE)
    assert isinstance(found, tuple) and [finding.rule for finding in found] == [rule]


def test_inner_functions_see_the_names_around_them() -> None:
    source = """def f(pos):
    weights = [1.0, 2.0]
    def scaled(x):
        return sum(w * x[:, i] for i, w in enumerate(weights))
    g = lambda y: scaled(y) + sum([k for k in weights])
    return g(pos), {}
"""
    assert isinstance(gate.check(source, STATE), gate.Program)


def test_guessing_names_takes_no_longer_than_reading_them() -> None:
    """Guessing for thousands of unknown names once took two minutes."""
    body = "\n".join(f"    pos_abcdefghijklmnop{i} + vel_{'x' * 20}{i}" for i in range(330))
    started = time.thread_time()
    found = gate.check(f"def f(pos):\n{body}\n    return pos[:, 0], {{}}\n", STATE)
    assert isinstance(found, tuple) and len(found) == 660
    assert time.thread_time() - started < 20.0


def test_nested_defaults_are_read_once() -> None:
    nested = "0"
    for _ in range(45):
        nested = f"lambda x={nested}: 0"
    started = time.thread_time()
    assert isinstance(gate.check(f"def f(pos):\n    h = {nested}\n    return pos[:, 0], {{}}\n", STATE), gate.Program)
    assert time.thread_time() - started < 20.0
