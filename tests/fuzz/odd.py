"""Writes programs and calls of operations with odd indices, literals, integer arithmetic and shapes."""

from __future__ import annotations

from random import Random
from typing import Any

from openeureka.reward import surface
from openeureka.reward.validate import operation
from openeureka.types import Node, RewardGraph

_INTEGERS = (
    "0", "1", "-1", "2", "7", "255", "256", "257", "300", "4096", "2**31", "-2**31", "2**62", "-2**63", "2**63 - 1",
    "num_envs", "-num_envs", "num_envs - 256", "num_envs // 2", "num_envs * num_envs", "0xFF", "1_000", "True",
)  # fmt: skip
_FLOATS = ("0.0", "-0.0", "1e38", "-1e308", "1e-320", "1e999", "0.5", "float('nan')", "torch.inf", "math.pi", "dt")
_TEXTS = ("0x" + "F" * 6000, "1" * 5000, "()", "[]", "{}", "...", "None", "''", "1e", "0b2", "1__0", "pos[", "\\", "1j")
_INDICES = (
    "()", "...", "None", "(None, ...)", "::-1", "::2", ":, 0", "..., 0", ":, -1", "256:", "-256:", ":256", "r > 0",
    "[]",":, [0, 2]", "(0,)", "phase.long()", "torch.arange(num_envs)", "torch.arange(3)", "num_envs:", ":num_envs, 1",
    "0:0","*(0,)", "lambda: 0", "r.long() % 3", "phase.abs().long().clamp(0, 2)",
)  # fmt: skip
_MODES = ('"trunc"', '"floor"', "None", '"x"')
_CASTS = (".long()", ".int()", ".bool()", ".half()", ".double()", ".float()", ".abs()", ".sign()", ".round()")
_SHAPED = (
    "torch.arange({i})", "torch.arange({i}, {i}, {i})", "torch.arange({f}, num_envs, {f})", "torch.full(({i},), {i})",
    "torch.zeros({i}, {i})", "torch.ones(num_envs, {i})", "torch.linspace({f}, {f}, {i})", "torch.eye(3)",
    "torch.tensor([{i}, {i}])", "torch.tensor({f})", "{t}.expand({i}, -1)", "{t}.repeat({i}, 1)",
    "{t}.reshape({i}, -1)","{t}.unsqueeze(0) * {t}.unsqueeze(1)", "torch.full((num_envs,), {i}, dtype=torch.int64)",
)  # fmt: skip
_UNARY = (
    "exp", "log", "sqrt", "abs", "neg", "sign", "floor", "cumsum", "sort", "argsort", "cumprod", "sum", "mean", "prod",
    "max", "min", "median", "roll", "flip", "topk", "softmax", "norm", "std", "round", "trunc", "squeeze", "isnan",
)  # fmt: skip
_BINARY = ("+", "-", "*", "/", "//", "%", "@", ">", "==", "&", "|", "and")
"""Without powers and shifts: with two large numbers Python computes for hours. In a run, a candidate's deadline ends
that."""


def program(random: Random) -> str:
    """A reward program with one to four random statements, most of which Python can parse."""
    body = "".join(f"    {_statement(random)}\n" for _ in range(random.randint(1, 4)))
    head = "def compute_reward(pos, vel, phase, dt, num_envs):\n    r = -pos.norm(dim=-1)\n"
    return f"{head}{body}    return r, {{'r': r}}\n"


def _statement(random: Random) -> str:
    kind, value = random.random(), _expression(random, 2)
    if kind < 0.45:
        return f"r = r + ({value})"
    if kind < 0.6:
        return f"r = {value}"
    if kind < 0.7:
        return f"r[{random.choice(_INDICES)}] {random.choice(('+=', '=', '*='))} {value}"
    if kind < 0.8:
        return f"pos {random.choice(('+', '-', '*', '/', '//', '%'))}= {value}"
    if kind < 0.9:
        return f"r = torch.where({_expression(random, 1)} > {_number(random)}, r, {value})"
    return f"r = torch.div({value}, {_expression(random, 1)}, rounding_mode={random.choice(_MODES)}) * 0 + r"


def _number(random: Random) -> str:
    kind = random.random()
    return random.choice(_INTEGERS if kind < 0.6 else _FLOATS if kind < 0.97 else _TEXTS)


def _expression(random: Random, depth: int) -> str:
    kind = random.random()
    if depth == 0 or kind < 0.15:
        return random.choice(("r", "pos", "vel", "phase", "pos[:, 0]", "r", "dt", "num_envs", _number(random)))
    inner = _expression(random, depth - 1)
    if kind < 0.3:
        return f"({inner})[{random.choice(_INDICES)}]"
    if kind < 0.5:
        return f"({inner} {random.choice(_BINARY)} {_expression(random, depth - 1)})"
    if kind < 0.6:
        return f"({inner}){random.choice(_CASTS)}"
    if kind < 0.8:
        made = random.choice(_SHAPED)
        for mark, numbers in (("{i}", _INTEGERS), ("{f}", _FLOATS)):
            while mark in made:
                made = made.replace(mark, random.choice(numbers), 1)
        return made.replace("{t}", f"({inner})")
    name, dim = random.choice(_UNARY), random.choice(("", "0", "1", "-1", "dim=-1", "dim=0", _number(random)))
    return f"torch.{name}({inner}{', ' if dim else ''}{dim})"


# --- calls of operations ---------------------------------------------------------------------------------------------


_NUMBERS = (0, 1, -1, 2, -2, 3, 7, 8, 255, 2**31 - 1, -(2**31), 2**63 - 1, -(2**63 - 1), 0.5, -0.0, 1e38, 1e308,
            float("inf"), float("-inf"), float("nan"), True, {"n": 1}, {"n": 2})  # fmt: skip
_SIZES = (0, 1, 2, 3, 5, -1, {"n": 1}, 64)
_NODES = (
    Node("input", ("pos",)),
    Node("input", ("phase",)),
    Node("full.default", (({"n": 1},), -(2**63 - 1)), {"dtype": "int64"}),
    Node("sub.Scalar", ({"ref": 2}, 1)),  # the smallest int64
    Node("full.default", (({"n": 1},), -1), {"dtype": "int64"}),
    Node("_to_copy.default", ({"ref": 3},), {"dtype": "int32"}),
    Node("full.default", (({"n": 1},), -(2**31)), {"dtype": "int32"}),
    Node("_to_copy.default", ({"ref": 4},), {"dtype": "int32"}),
    Node("gt.Scalar", ({"ref": 1}, 0.0)),
    Node("full.default", (({"n": 1}, 3), float("nan"))),
    Node("full.default", ((), -1), {"dtype": "int64"}),
    Node("zeros.default", ((0, 3),)),
    Node("arange.default", ({"n": 1},)),
    Node("_to_copy.default", ({"ref": 0},), {"dtype": "float16"}),
    Node("full.default", (({"n": 1},), 1e308), {"dtype": "float64"}),
)
"""Arguments of the calls. Among them are most dtypes, extreme values, an empty tensor and one without dimensions."""


def call(random: Random) -> RewardGraph:
    """A graph whose last node calls an allow-listed operation with hostile numbers, most often of the types that its
    schema names."""
    op = random.choice(sorted(surface.ATEN))
    args: list[Any] = []
    kwargs: dict[str, Any] = {}
    for argument in operation(op)._schema.arguments:  # type: ignore[attr-defined]
        if argument.has_default_value() and random.random() < 0.4:
            if not argument.kwarg_only:
                break
            continue
        value = _argument(argument.name, str(argument.real_type), random)
        if argument.kwarg_only:
            kwargs[argument.name] = value
        else:
            args.append(value)
    nodes = (*_NODES, Node(op, tuple(args), kwargs))
    return RewardGraph(nodes=nodes, reward=len(nodes) - 1, components=())


def _argument(name: str, kind: str, random: Random) -> Any:
    if kind.startswith("Optional["):
        return None if random.random() < 0.3 else _argument(name, kind[len("Optional[") : -1], random)
    if kind.startswith("List["):
        inner = kind[len("List[") : -1]
        return tuple(_argument(name, inner, random) for _ in range(random.choice((0, 1, 1, 2, 2, 3))))
    if kind == "Tensor":
        return {"ref": random.randrange(len(_NODES))} if random.random() < 0.9 else random.choice(_NUMBERS)
    if name.startswith("dim"):
        return random.choice((0, 1, -1, 2, -2))
    if name in ("size", "repeats", "split_sizes", "k", "m", "n", "steps") and random.random() < 0.9:
        return random.choice(_SIZES)
    return {
        "bool": random.random() < 0.5,
        "str": random.choice(("trunc", "floor", "none", "tanh")),
        "ScalarType": random.choice(sorted(surface.DTYPES)),
        "MemoryFormat": "contiguous_format",
        "Layout": None,
        "Device": None,
    }.get(kind, random.choice(_NUMBERS))
