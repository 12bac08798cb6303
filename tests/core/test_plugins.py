"""`search=` and `executor=` find what is built in, what a package brings along, and what somebody names."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest

from openeureka.config import RunConfig
from openeureka.errors import ConfigError, nearest
from openeureka.executors import EXECUTORS
from openeureka.executors.local import LocalExecutor
from openeureka.llm import open_model
from openeureka.parsing import parse
from openeureka.plugins import Door, import_file
from openeureka.strategies import SEARCHES, Best, Eureka

CONFIG = RunConfig(sample=3)
MODULE = """
class Tournament:
    ranks, peaks = "played", ("last",)

    def __init__(self, config):
        self.samples = config.sample

    def ask(self, history, rng): ...


class Half:
    ranks = "played"

    def __init__(self, config): ...


class Bare: ...


class Oracle:
    name, style, sample, close = "oracle", "free", None, None

    def __init__(self, config): ...


samples = 3
"""


@pytest.fixture(autouse=True)
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installed package with a search `tournament`, another that calls itself `best`, and a model `oracle`."""
    (tmp_path / "bracket.py").write_text(MODULE)
    (tmp_path / "broken.py").write_text("x = 1\nimport nowhere_to_be_found\n")
    about = tmp_path / "bracket-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: bracket\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(
        "[openeureka.searches]\ntournament = bracket:Tournament\nbest = bracket:Tournament\n"
        "[openeureka.models]\noracle = bracket:Oracle\n"
    )
    monkeypatch.syspath_prepend(tmp_path)


def made(name: str, door: Door = SEARCHES):
    return door.make(name, CONFIG)


def test_built_in_ones_come_first_and_are_replaced_by_no_package():
    assert SEARCHES.names() == ["best", "eureka", "tournament"]
    assert (made("best"), made("eureka")) == (Best(3), Eureka(3))
    executor = EXECUTORS.make("local", device="cpu", threads=1, snapshots=Path("snapshots"))
    assert isinstance(executor, LocalExecutor)


@pytest.mark.parametrize("name", ["tournament", "bracket:Tournament"])
def test_those_of_a_package_are_found_by_entry_point_and_by_import_string(name):
    strategy = made(name)
    assert (type(strategy).__name__, strategy.samples) == ("Tournament", 3)


def test_a_file_needs_no_place_where_python_finds_it(tmp_path, monkeypatch):
    folder = tmp_path / "else:where"
    folder.mkdir()
    (folder / "mine.py").write_text(MODULE)
    assert "mine" not in sys.modules and made(f"{folder}/mine.py:Tournament").samples == 3
    assert open_model(RunConfig(model=f"{folder}/mine.py:Oracle")).name == "oracle"
    monkeypatch.chdir(folder)
    assert type(made("mine.py:Tournament")) is type(made(f"{folder}/mine.py:Tournament"))


def test_settings_keep_the_whole_path_of_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for key in ("search", "executor", "model"):
        assert getattr(parse(RunConfig, [f"{key}=a/mine.py:Mine"]), key) == f"{tmp_path}/a/mine.py:Mine"
        assert getattr(parse(RunConfig, [f"{key}=pkg.mine:Mine"]), key) == "pkg.mine:Mine"
        assert not SEARCHES.installed("a/mine.py:Mine")
    assert parse(RunConfig, ["model=local:weights.gguf"]).model == f"local:{tmp_path}/weights.gguf"
    assert parse(RunConfig, ["model=local:hub:a/b/c.gguf"]).model == "local:hub:a/b/c.gguf"
    assert parse(RunConfig, ["model=llama3:latest"]).model == "llama3:latest"


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("nowhere.py:Search", "There is no file {folder}/nowhere.py; search=FILE.py:Name must name an existing file."),
        ("bracket.py", "Name the class or function in bracket.py: search=bracket.py:Name."),
        ("bracket.py:Turnament", "There is no class or function `Turnament` in bracket.py. Did you mean `Tournament`?"),
        ("ends.py:Search", "`search=ends.py:Search` cannot be imported: sys.exit(0) was called; raise an error"),
        ("fails.py:make", "`search=fails.py:make` failed in fails.py, line 2: KeyError: 'key'."),
        ("silent.py:Search", "`search=silent.py:Search` cannot be imported: ValueError."),
        ("broken.py:Search", "`search=broken.py:Search` cannot be imported: ModuleNotFoundError: No module named"),
        (
            "cut.py:Search",
            "`search=cut.py:Search` cannot be imported: SyntaxError: '(' was never closed (cut.py, line 1)",
        ),
    ],
)
def test_what_no_file_holds_is_one_sentence(tmp_path, monkeypatch, value, says):
    (tmp_path / "cut.py").write_text("f(\n")
    (tmp_path / "fails.py").write_text("def make(config):\n    return {}['key']\n")
    (tmp_path / "silent.py").write_text("raise ValueError\n")
    (tmp_path / "ends.py").write_text("raise SystemExit(0)\n")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigError, match=r"^[^\n]*$") as refused:
        made(value)
    assert str(refused.value).startswith(says.format(folder=tmp_path))


def test_a_package_may_give_a_model_a_short_name():
    assert open_model(RunConfig(model="oracle")).name == "oracle"
    at_endpoint = open_model(RunConfig(model="oracle", base_url="http://127.0.0.1:1/v1"))
    assert type(at_endpoint).__name__ == "EndpointModel"


def test_only_a_name_that_is_listed_counts_as_installed():
    assert SEARCHES.installed("tournament") and SEARCHES.installed("eureka")
    assert not SEARCHES.installed("bracket:Tournament") and not SEARCHES.installed("")
    assert not EXECUTORS.installed("tournament")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        (
            "greedy",
            "There is no search `greedy`. Use best, eureka, tournament, or your own: pkg.mod:Name or FILE.py:Name.",
        ),
        ("eurkea", "Did you mean `eureka`?"),
        ("", "There is no search ``."),
        (
            "nowhere:Search",
            "`search=nowhere:Search` cannot be imported: ModuleNotFoundError: No module named",
        ),
        ("broken:Search", "cannot be imported: ModuleNotFoundError: No module named 'nowhere_to_be_found'"),
        (":Search", "`search=:Search` cannot be imported: ValueError"),
        ("bracket:Turnament", "There is no class or function `Turnament` in bracket. Did you mean `Tournament`?"),
        ("bracket:samples", "There is no class or function `samples` in bracket."),
        ("bracket:Bare", "`search=bracket:Bare` cannot be called with (RunConfig)"),
        ("bracket:Half", "The object that `search=bracket:Half` makes lacks peaks, ask."),
    ],
)
def test_what_is_none_is_one_sentence(name, says):
    with pytest.raises(ConfigError, match=r"^[^\n]*$") as refused:
        made(name)
    assert says in str(refused.value)


def test_an_executor_is_called_with_settings_of_its_own():
    door = replace(EXECUTORS, built_in={"mine": "bracket:Tournament"})
    with pytest.raises(ConfigError, match=r"cannot be called with \(device=, threads=, snapshots=\)"):
        door.make("mine", device="cpu", threads=1, snapshots=Path("snapshots"))


def test_a_file_that_several_threads_import_is_executed_once(tmp_path: Path):
    (tmp_path / "slow.py").write_text("import time\n\ntime.sleep(0.2)\nmade = object()\n")
    with ThreadPoolExecutor(3) as pool:
        made = {module.made for module in pool.map(import_file, [tmp_path / "slow.py"] * 3)}
    assert len(made) == 1


def test_an_edit_of_equal_length_within_a_second_is_seen(tmp_path: Path):
    file = tmp_path / "edited.py"
    for made in (1, 2):
        file.write_text(f"made = {made}\n")
        os.utime(file, (1e9, 1e9))
        assert import_file(file).made == made
    assert not (tmp_path / "__pycache__").exists()


def test_a_suggestion_ignores_case_and_spells_the_name_as_it_is_known():
    assert nearest("EUREKA", ["best", "eureka"]) == " Did you mean `eureka`?"
    assert nearest("hopper-V5", ["Ant-v5", "Hopper-v5"]) == " Did you mean `Hopper-v5`?"
    assert nearest("pen", ["Ant-v5", "Hopper-v5"]) == ""
