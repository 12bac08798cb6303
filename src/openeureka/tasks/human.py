"""A task's human reward: a reward program like any other, so that it is read, traced and trained as one.

It is as trusted as the task's own code: both run in whatever process steps the task.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from torch import Tensor

from ..errors import TaskError
from ..reward import gate, graph, probe
from ..reward.load import load
from ..reward.trace import Refused
from ..types import Finding, RewardGraph

if TYPE_CHECKING:
    from .task import Task

_CONSTANT = re.compile(r"^([A-Z][A-Z0-9_]*) = [^\n#]*[^\s#]", re.MULTILINE)


_WAY = "set `human = ...` in the task, or write the reward to a file and name it with init=FILE.py"


def program(task: type[Task], way: str = _WAY) -> str:
    """The reward that its original authors wrote, as the text of a reward program.

    A constant with the name of an attribute of the task, in capitals, has the attribute's value: `TOLERANCE` is 0.2 for
    `NAME+tolerance=0.2`.

    Args:
        way: advice for a person where there is no program.

    Raises:
        TaskError: when the task, or one that it builds on, has a method for it instead.
    """
    from .task import Task  # which imports this module

    if not task.human or task.human_reward is not Task.human_reward:
        raise TaskError(f"The human reward of `{task.env}` is a method, not a program; {way}.")

    def of_task(found: re.Match[str]) -> str:
        value = getattr(task, found[1].lower(), None)
        return f"{found[1]} = {value!r}" if isinstance(value, bool | int | float) else found[0]

    return _CONSTANT.sub(of_task, _text(task))


def _text(task: type[Task]) -> str:
    if not isinstance(task.human, Path):
        return textwrap.dedent(task.human).strip() + "\n"
    try:
        return task.human.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise TaskError(f"The human reward of `{task.env}` cannot be read from {task.human}: {error}.") from None


def compiled(task: type[Task], state: Mapping[str, Any]) -> graph.CompiledReward:
    """The program as a function of the state, without its components.

    Args:
        state: any state of the task, to trace the program on.

    Raises:
        TaskError: when the program breaks a rule of reward programs.
    """
    checked = gate.check(program(task), task.spec)
    if not isinstance(checked, gate.Program):
        raise _refused(task, checked[0])
    if not any(name in task.spec.per_world for name in checked.inputs):
        raise _refused(task, Finding(rule="constant-reward", message="it does not depend on the state"))
    recorded = {
        name: value.detach().cpu() if isinstance(value, Tensor) else value
        for name, value in state.items()
        if name in checked.inputs
    }
    try:
        traced = probe.probe(load(checked), task.spec, recorded).graph
    except Refused as refusal:
        raise _refused(task, refusal.finding) from None
    # Components would be computed in every step, and nobody looks at them.
    alone, _ = graph.simplify(RewardGraph(nodes=traced.nodes, reward=traced.reward, components=()))
    return graph.CompiledReward(alone, task.spec)


def _refused(task: type[Task], finding: Finding) -> TaskError:
    return TaskError(f"The human reward of `{task.env}` is refused: {finding.sentence()}.")
