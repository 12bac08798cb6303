"""The classes that guides show, typed as the page says, pass the conformance suites that the package ships, though with
shorter trainings."""

import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from openeureka.config import RunConfig
from openeureka.llm import open_model
from openeureka.reward import extract
from openeureka.types import Message, Prompt

GUIDES = Path(__file__).parents[2] / "docs" / "guides"


def test_the_extensions_of_guides_keep_the_promises_of_their_suites(tmp_path: Path):
    promised = dict[str, int]()
    for name in ("search", "executor"):
        page = (GUIDES / f"your-own-{name}.md").read_text()
        module, test = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
        assert len(module.splitlines()) < 40
        for file, text in ((f"my_{name}.py", module), (f"test_my_{name}.py", test)):
            assert f"`{file}`" in page
            (tmp_path / file).write_text(text.replace("env_steps=4096", "env_steps=1024"))  # 4 epochs, not 16
        (count,) = re.findall(r"You will see `(\d+) passed`", page)
        promised[name] = int(count)
    command = [sys.executable, "-m", "pytest", "-v", "-p", "no:cacheprovider"]  # one for both: each loads torch
    said = subprocess.run(command, cwd=tmp_path, env=os.environ, capture_output=True, text=True, check=False).stdout
    passed = re.findall(r"^test_my_(\w+)\.py::.* PASSED", said, re.MULTILINE)
    assert Counter(passed) == promised and f"{len(passed)} passed in" in said, said


def test_the_model_that_its_guide_shows_writes_rewards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    page = (GUIDES / "models.md").read_text()
    (module,) = re.findall(r"```python\n(from openeureka.*?)\n```\n\n", page, re.DOTALL)
    assert "model=my_model:MyModel" in page
    (tmp_path / "my_model.py").write_text(module)
    monkeypatch.syspath_prepend(tmp_path)
    model = open_model(RunConfig(model="my_model:MyModel"))
    (reply,) = model.sample(Prompt(messages=(Message("user", "Write the reward."),)), n=1, seed=0)
    assert "return up_vec[:, 2], {}" in (extract.program(reply.text) or "")
