"""A reward as a term of mjlab's or Isaac Lab's reward manager, with the state that `scene.py` reads there."""

from __future__ import annotations

import inspect
from pprint import pformat

from ...drafting.source import template
from ...errors import TaskError
from ...reward.graph import spelled
from ...types import RewardGraph, StateSpec
from ..gym.export import variables_read
from . import scene

_SUITES = {
    "mjlab": ("mjlab", "from mjlab.managers.reward_manager import RewardTermCfg"),
    "isaaclab": ("Isaac Lab", "from isaaclab.managers import RewardTermCfg"),
}
"""What a suite is called, and how its reward terms are imported."""


def terms(env: str, suite: str, spec: StateSpec, graph: RewardGraph, program: str) -> str:
    """The text of the file. Raises TaskError for a suite without reward managers, and for a reward that reads the
    observation, which these suites compute after the reward."""
    if suite not in _SUITES:
        raise TaskError(f"Rewards cannot be exported for the suite of `{env}`; the best reward is `best/reward.py`.")
    title, term = _SUITES[suite]
    names = [name for name in spec.names if name not in ("obs_buf", "previous_obs_buf")]
    used = variables_read(env, graph, names)
    readers = [scene.scene_state, *([scene.attribute_state] if suite == "isaaclab" else [])]
    fields = {
        name: attribute
        for name, (attribute, _) in scene.FIELDS.items()
        if any(variable.endswith(f"_{name}") for variable in used)
    }
    return template("terms.py.jinja").render(
        env=env.partition("+")[0],
        title=title,
        direct=suite == "isaaclab",
        program=program,
        fields=pformat(fields, width=118),
        buffers=scene.BUFFERS,
        readers="\n\n".join(inspect.getsource(reader) for reader in readers),
        reward=spelled(graph, spec),
        term=term,
    )
