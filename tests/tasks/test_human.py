"""Every task's human reward as a program gives the numbers of `human_reward`."""

from pathlib import Path

import pytest
import torch

from openeureka.errors import TaskError
from openeureka.reward import gate
from openeureka.reward.load import load
from openeureka.tasks import human
from openeureka.tasks.registry import get, make, names

WORLDS = 5


@pytest.mark.parametrize("env", names())
def test_the_program_passes_the_gate_and_gives_the_same_numbers(env: str) -> None:
    checked = gate.check(human.program(env), get(env).spec)
    assert isinstance(checked, gate.Program), checked
    simulation = make(env, worlds=WORLDS, threads=1)
    simulation.reset()
    generator = torch.Generator().manual_seed(0)
    actions = torch.randn(3, WORLDS, simulation.task.num_actions, generator=generator)
    for action in actions:
        state = simulation.step(action).state
        reward, components = load(checked)({**state, "num_envs": WORLDS, "device": torch.device("cpu")})  # type: ignore[misc]
        torch.testing.assert_close(reward, simulation.task.human_reward(state))
        assert components


def test_the_terms_of_a_sum_are_its_components_and_constants_have_names() -> None:
    text = human.program("ant")
    assert "FALL_HEIGHT = 0.31\n" in text
    ending = text[text.index("return (torch.where(terminated(torso_height), -2.0, reward), ") :]
    for name in ("sparse_reward", "posture_reward", "effort", "energy", "at_limit"):
        assert f"'{name}': " in ending
    assert "self" not in text and "s[" not in text


def test_a_reward_that_depends_on_the_past_is_refused_with_its_reason(tmp_path: Path) -> None:
    (tmp_path / "lagging.py").write_text(
        "from openeureka.tasks.classic.cartpole import Cartpole\n\n\n"
        "class Lagging(Cartpole):\n"
        "    def human_reward(self, s):\n"
        "        return s['pole_angle'] - self.progress\n"
    )
    with pytest.raises(TaskError, match=r"depends on the past, through `progress`\); write one yourself: init=FILE.py"):
        human.program(f"{tmp_path / 'lagging.py'}:Lagging")
