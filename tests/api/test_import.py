"""What `import openeureka` offers, and what it costs."""

import dataclasses
import inspect
import subprocess
import sys
from typing import get_type_hints

import pytest

import openeureka
from openeureka import RobustSettings, SearchSettings, TrainSettings
from openeureka.config import RobustConfig, RunConfig, TrainConfig

LIGHT = """
import sys
before = set(sys.modules)
import openeureka
print(len(set(sys.modules) - before) < 100, sorted({"torch", "mujoco", "openai", "numpy"} & set(sys.modules)))
"""


def test_importing_it_loads_few_modules_and_nothing_heavy():
    done = subprocess.run([sys.executable, "-c", LIGHT], capture_output=True, text=True)
    assert done.stdout == "True []\n", done.stdout + done.stderr


def test_all_that_it_names_is_there_and_says_what_it_is():
    for name in openeureka.__all__:
        found = getattr(openeureka, name)
        assert name in dir(openeureka)
        if inspect.isfunction(found) or inspect.isclass(found):
            assert inspect.getdoc(found)
    with pytest.raises(AttributeError, match="no attribute 'serach'"):
        openeureka.serach  # noqa: B018


@pytest.mark.parametrize(
    ("typed", "config", "own"),
    [
        (SearchSettings, RunConfig, {"env", "model"}),
        (TrainSettings, TrainConfig, {"env", "reward"}),
        (RobustSettings, RobustConfig, {"model"}),
    ],
)
def test_keyword_arguments_are_the_settings_of_the_command_line(typed, config, own):
    fields = {field.name for field in dataclasses.fields(config)}
    assert get_type_hints(typed).keys() - {"python"} == fields - own
    kinds = get_type_hints(config) | {"python": str}
    assert all(kinds[name] in (kind, *getattr(kind, "__args__", ())) for name, kind in get_type_hints(typed).items())
