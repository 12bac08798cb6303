"""Programs that take time, memory or output without end."""

from __future__ import annotations

from .case import Hostile, gate, gate_text, out_of_memory, out_of_time, probe, returns

_DIVIDED = """least = torch.full((num_envs,), -(2**63), dtype=torch.int64)
by = torch.where({condition}, torch.tensor(-1), torch.tensor(1))
r = r + torch.div(least, by, rounding_mode="trunc") * 0"""
"""Dividing the least integer by -1 ends a process; the condition hides it from checks with other numbers of worlds."""
_MANY_LISTS = "{above}def compute_reward(pos{default}):\n    return pos[:, 0], {{}}\n"
"""Lists of empty lists: a limit that counts only numbers would let them be multiplied out while the text is read."""

RESOURCES: tuple[Hostile, ...] = (
    gate(41, "endless-while", "statement", "while True:\n    pass"),
    gate(42, "huge-range", "loop-size", "for i in range(1000000000000):\n    pass"),
    out_of_time(42, "huge-computed-range", "for i in range(10**12):\n    pass"),
    out_of_time(43, "loop-in-c", "n = 10**6\nsum(range(n * n))"),
    out_of_time(44, "big-power", "a = 10\nb = a**8\nc = a**b"),
    out_of_memory(45, "huge-tensor", "torch.zeros(10**6, 10**6)"),
    out_of_memory(46, "huge-list", "x = [0] * 10**6 * 10**6"),
    out_of_memory(46, "huge-text", 'x = "a" * 10**6 * 10**6'),
    out_of_memory(46, "huge-range-list", "x = list(range(10**10))"),
    gate_text(46, "huge-constant", "statement", _MANY_LISTS.format(above="A = [[]] * 1000000000\n", default="")),
    gate_text(46, "huge-default", "signature", _MANY_LISTS.format(above="", default=", a=[[]] * 1000000000")),
    gate(47, "format-width", "f-string", 'x = f"{1:1000000000}"'),
    out_of_memory(47, "percent-width", 'x = "%10000000000d" % 1'),
    probe(48, "worlds-squared", "memory", "r = r + (pos.unsqueeze(0) * pos.unsqueeze(1)).sum(-1).sum(-1) * 0"),
    probe(48, "column-against-row", "memory", "r = r + (r.unsqueeze(-1) - r).sum(-1) * 0"),
    gate_text(49, "unary-minuses", "size", f"def compute_reward(pos):\n    return {'-' * 5000}pos[:, 0], {{}}\n"),
    gate_text(49, "long-sum", "size", f"def compute_reward(pos):\n    return {'+'.join(['pos'] * 6000)}, {{}}\n"),
    gate_text(49, "parentheses", "syntax", f"def compute_reward(pos):\n    return {'(' * 500}pos{')' * 500}, {{}}\n"),
    gate_text(49, "attribute-chain", "size", f"def compute_reward(pos):\n    return pos{'.T' * 5000}, {{}}\n"),
    gate_text(
        50, "megabyte-of-comments", "size", "# x\n" * 250_000 + "def compute_reward(pos):\n    return pos[:, 0], {}\n"
    ),
    probe(
        51, "deep-list", "error", "x = []\nfor i in range(200):\n    for j in range(1000):\n        x = [x]\ny = str(x)"
    ),
    probe(52, "loop-over-worlds", "world-count", "x = [r[i] for i in range(num_envs)]\nr = torch.stack(x)"),
    gate(53, "sleep", "import", "import time\ntime.sleep(100)"),
    gate(54, "catches-everything", "statement", "try:\n    x = [0] * 10**12\nexcept MemoryError:\n    pass"),
    returns(55, "many-components", "components", "(r, {str(i) + 'x': r for i in range(1000)})"),
    returns(55, "long-name", "components", "(r, {'x' * 10**6: r})"),
    returns(55, "component-of-components", "components", "(r, {'r': {'r': r}})"),
    probe(56, "huge-message", "error", 'raise ValueError("x" * 10**8)'),
    gate(56, "prints-for-ever", "statement", 'while True:\n    print("x" * 10**6)'),
    probe(91, "truncated-least-integer", "integer-division", _DIVIDED.format(condition="torch.tensor(num_envs) == 7")),
    probe(
        91, "truncated-with-many-worlds", "integer-division", _DIVIDED.format(condition="torch.tensor(num_envs) > 300")
    ),
    probe(
        91,
        "truncated-in-place",
        "integer-division",
        'x = pos.long()\nx.div_(vel.long(), rounding_mode="trunc")\nr = r + x.sum(dim=-1)',
    ),
    probe(
        92,
        "large-between-two-sizes",
        "memory",
        "x = torch.arange(16384.0, num_envs, -0.0154)\nr = r + (x * pos[256:, :1]).sum() * 0",
    ),
)
