"""The real dm_control, where DMC_PYTHON names a Python that has it. It takes 200 MB, and a second MuJoCo."""

import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
import torch

pytest.importorskip("gymnasium", reason="needs Gymnasium: pip install 'openeureka[gym]'")

from openeureka.cli.main import main
from openeureka.reward import gate
from openeureka.reward.load import load
from openeureka.tasks import registry
from openeureka.testing.conformance.task import TaskConformance

from .test_guide import Here

PYTHON = os.environ.get("DMC_PYTHON", "")
pytestmark = pytest.mark.skipif(not PYTHON, reason="needs DMC_PYTHON=PATH, a Python with dm_control and mujoco<4")
ITSELF = """
import sys
import numpy as np
from dm_control import suite
actions, seed, name = np.load(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
env = suite.load(*name.split("-", 1), task_kwargs={"random": 0})
env.task.random.seed(seed)
moments = [env.reset()]
moments += [env.step(action) for action in actions]
flat = [np.concatenate([np.ravel(value) for value in moment.observation.values()]) for moment in moments]
last = [moment.last() for moment in moments[1:]]
np.savez(sys.argv[1] + ".npz", seen=flat, paid=[moment.reward for moment in moments[1:]], last=last)
"""


@pytest.mark.parametrize(
    "name, steps",
    [
        ("cheetah-run", 200),
        ("walker-walk", 200),
        ("cartpole-swingup", 1000),
        ("reacher-easy", 200),
        ("humanoid-stand", 200),
    ],
)
def test_observation_reward_and_end_are_those_of_dm_control(name: str, steps: int, tmp_path: Path):
    ours = registry.make(f"dmc:{name}+python={PYTHON}", worlds=1)
    seen, seed = [ours.reset()[0]], int(ours.task.gym.seeds[0])
    random = np.random.default_rng(0).uniform(-1.0, 1.0, (steps, ours.task.num_actions)).astype(np.float32)
    paid, ended = [], []
    for action in random:
        step = ours.step(torch.from_numpy(action)[None])
        seen.append(step.final_observation[0])
        paid.append(float(ours.task.paid[0]))
        ended.append(bool(step.timed_out[0]))
        assert not bool(step.terminated[0])
    np.save(tmp_path / "actions.npy", ours.task.survey.actions.taken(torch.from_numpy(random)))
    arguments = [str(tmp_path / "actions.npy"), str(seed), name]
    subprocess.run([PYTHON, "-c", ITSELF, *arguments], check=True, capture_output=True)
    theirs = np.load(tmp_path / "actions.npy.npz")
    np.testing.assert_array_equal(torch.stack(seen), theirs["seen"].astype(np.float32))
    np.testing.assert_array_equal(np.float32(paid), theirs["paid"].astype(np.float32))
    assert ended == theirs["last"].tolist() == [False] * (steps - 1) + [steps == 1000]


PROGRAM = """
import torch


def compute_reward(speed, qvel):
    fast = torch.clamp(speed / 10.0, 0.0, 1.0)
    return fast, {"fast": fast, "wheel": qvel[:, 0]}
"""


def test_dm_controls_own_reward_written_as_a_program_pays_the_same():
    ours = registry.make(f"dmc:cheetah-run+python={PYTHON}", worlds=2)
    checked = gate.check(PROGRAM, ours.task.spec)
    assert isinstance(checked, gate.Program), checked
    reward = load(checked)
    ours.reset()
    forward = torch.ones(2, 6)
    for number in range(40):
        state = ours.step(forward * (-1.0) ** (number // 8)).state
        torch.testing.assert_close(reward(state)[0], ours.task.human_reward(state), atol=1e-6, rtol=0.0)
    assert float(ours.task.returned.abs().max()) > 0.0


def test_a_search_runs_from_end_to_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", lambda **_: Here())
    small = ["sample=1", "iteration=1", "steps=2048", "seeds=1", "video=none", f"dir={tmp_path}"]
    with pytest.raises(SystemExit) as ended:
        main(["run", "env=dmc:cartpole-swingup+episode_length=30", f"python={PYTHON}", "model=random", *small])
    assert ended.value.code == 0 and (tmp_path / "best" / "reward.py").exists()


class TestCartpole(TaskConformance):
    env = f"dmc:cartpole-swingup+python={PYTHON}"
    random_worlds = 8
