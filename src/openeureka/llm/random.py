"""The baseline without a model: random reward programs of the typed grammar."""

from __future__ import annotations

import re
from collections.abc import Iterator
from random import Random

from ..errors import ModelError
from ..types import Prompt, Reply, Style
from . import gbnf

_TRIES = 100
_TERM = re.compile(r'    # .*\n(    x_* = (.+)\n    reward_* = .+\n    components_*)\["\w+"\] = (x_*)\n')
_MARK = re.compile(r'    # .*\n(    components_*)\["progress_\w+"\] = (.+)\n')
"""The local variable `x` is called `x_` where the task has a variable `x`: see `grammar`."""
_VARIABLE = re.compile(r"(?<![\w.])([A-Za-z_]\w*)\b(?:\[:, (\d+)\])?(?!\s*=)")
_FORMS = {"torch.exp(": "close", " > ": "above", " < ": "below", "torch.clamp(": "bounded"}
MAX_NAME = 48


class RandomModel:
    """Draws strings of the prompt's grammar, and reads nothing else of the prompt: no results, no remarks of a person.

    The control for the embedded model: whatever a search finds with this one is due to selection alone. Where the
    grammar leaves names free, components are named by what they measure.
    """

    name = "random"
    style: Style = "grammar"

    def sample(self, prompt: Prompt, *, n: int, seed: int) -> Iterator[Reply]:
        """Yield n different replies, always the same ones for a prompt and a seed."""
        if prompt.grammar is None:
            raise ValueError("the random model needs a prompt with a grammar")
        rules = gbnf.parse(prompt.grammar)
        random = Random(seed)
        seen: set[str] = set()
        for _ in range(n * _TRIES):
            if len(seen) == n:
                return
            text = named(gbnf.derive(rules, random))
            if text not in seen:
                seen.add(text)
                yield Reply(text=prompt.prefill + text, model=self.name)
        if len(seen) < n:
            raise ModelError(f"The grammar of this task has fewer than {n} programs; lower sample=.")

    def close(self) -> None:
        """Holds nothing."""


def named(text: str) -> str:
    """A drawn program with each component named by what it measures, in place of random letters."""
    taken: set[str] = set()

    def fresh(base: str) -> str:
        name, number = base, 1
        while name in taken:
            number += 1
            name = f"{base}_{number}"
        taken.add(name)
        return name

    def term(match: re.Match[str]) -> str:
        name = fresh(_measured(match[2]))
        return f'    # {name.replace("_", " ")}\n{match[1]}["{name}"] = {match[3]}\n'

    def mark(match: re.Match[str]) -> str:
        name = fresh(f"progress_{_measured(match[2])}")
        return f'    # {name.replace("_", " ")}\n{match[1]}["{name}"] = {match[2]}\n'

    found, count = _TERM.subn(term, _MARK.sub(mark, text))
    return re.sub(r"\A .*\n", " drawn at random\n", found) if count else text


def _measured(expression: str) -> str:
    """`torch.exp(-torch.abs(angle) / 0.5)` -> `angle_close`."""
    variables = dict.fromkeys(_VARIABLE.findall(expression))
    words = ["_".join(filter(None, variable)) for variable in variables if variable[0] not in ("torch", "dim")]
    forms = [word for sign, word in _FORMS.items() if sign in expression]
    return "_".join((*words, *forms))[:MAX_NAME].strip("_") or "term"
