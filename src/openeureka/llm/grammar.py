"""The typed grammar of a task: every reward program that the embedded model can write for it.

A small model makes mistakes in names, shapes and signs. The grammar leaves it no choice there: names, columns and equal
sizes come from the state table, signs from `StateVar.use`. The model decides what to reward, and how much.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files
from itertools import combinations

from ..errors import TaskError
from ..types import StateSpec, StateVar
from . import gbnf

_MAX_COLUMNS = 4
"""Vectors up to this size are offered by column: beyond it, a column number means nothing to a reader."""
_LOCALS: tuple[str, ...] = ("x", "reward", "components")
"""Local variables in the programs of `reward.gbnf`."""


def offered(spec: StateSpec) -> tuple[StateVar, ...]:
    """The variables the grammar uses, which are the arguments of its programs. Raises TaskError when the task marks
    none."""
    variables = tuple(v for v in spec.variables if v.use != "raw" and v.kind == "world" and len(v.shape) <= 1)
    if not variables:
        raise TaskError(
            "This task marks no state variable as zero_centred, directional or point, so the typed grammar has no "
            "variables: set `use` in its StateSpec, or choose a model that writes free text (model=NAME)."
        )
    return variables


def prefill(spec: StateSpec) -> str:
    """What the answer begins with: code fence, imports, signature, and the first words of the plan."""
    arguments = "".join(f"    {variable.name}: torch.Tensor,\n" for variable in offered(spec))
    return (
        "```python\nimport torch\nfrom typing import Dict, Tuple\n\n\n"
        f"def compute_reward(\n{arguments}) -> Tuple[torch.Tensor, Dict[str, torch.Tensor]]:\n    # plan:"
    )


def grammar(spec: StateSpec, *, progress: bool = False) -> str:
    """GBNF of all that may follow `prefill(spec)`.

    Args:
        progress: whether programs tell how far an episode has come.
    """
    variables = offered(spec)
    names = _locals(variables)
    frame = _rules("reward", names) | (_rules("progress", names) if progress else {})
    leaves = {name: tuple(map(gbnf.literal, texts)) for name, texts in _leaves(variables, names).items() if texts}
    return gbnf.render(gbnf.prune({**frame, **leaves}))


def _locals(variables: tuple[StateVar, ...]) -> dict[str, str]:
    """The name that each of `_LOCALS` has in programs: with a `_` where it would overwrite a variable of the task."""
    taken = {variable.name for variable in variables}
    found = {name: name for name in _LOCALS}
    for name in _LOCALS:
        while found[name] in taken:
            found[name] += "_"
    return found


def _rules(name: str, names: Mapping[str, str]) -> dict[str, tuple[gbnf.Sequence, ...]]:
    text = (files("openeureka") / "templates" / f"{name}.gbnf").read_text()
    return gbnf.parse(re.sub(rf"\b({'|'.join(names)})\b", lambda match: names[match[0]], text))


def _leaves(variables: tuple[StateVar, ...], names: Mapping[str, str]) -> dict[str, list[str]]:
    """Expressions of each leaf of `reward.gbnf`."""
    centred = [v for v in variables if v.use == "zero_centred"]
    points = [v for v in variables if v.use == "point"]
    pairs = [(a, b) for a, b in combinations(points, 2) if a.shape == b.shape]
    paired = {v.name for pair in pairs for v in pair}
    # A point that nothing can be compared with still has meaningful coordinates, a height for example.
    directed = [v for v in variables if v.use == "directional"] + [v for v in points if v.name not in paired]
    return {
        "start": [_start(variables[0], names)],
        "offset": [
            *(text for v in centred for text in _scalars(v)),
            *(f"{x} - {y}" for a, b in pairs for x, y in zip(_scalars(a), _scalars(b), strict=True)),
        ],
        "spread": [v.name for v in centred if v.shape and v.shape != (1,)],
        "gap": [f"{a.name} - {b.name}" for a, b in pairs if a.shape],
        "amount": [text for v in directed for text in (_scalars(v) or [f"torch.mean({v.name}, dim=-1)"])],
    }


def _scalars(variable: StateVar) -> list[str]:
    """The variable, or each of its columns, as expressions of shape (N,); empty when there are too many."""
    if not variable.shape:
        return [variable.name]
    columns = variable.shape[0]
    return [f"{variable.name}[:, {i}]" for i in range(columns)] if columns <= _MAX_COLUMNS else []


def _start(variable: StateVar, names: Mapping[str, str]) -> str:
    like = f"{variable.name}[:, 0]" if variable.shape else variable.name
    reward, components = names["reward"], names["components"]
    return f"    {reward} = torch.zeros_like({like})\n    {components}: Dict[str, torch.Tensor] = {{}}\n"
