"""`search=` and `executor=` find what is built in, what a package brings along, and what somebody names."""

from dataclasses import replace
from pathlib import Path

import pytest

from openeureka.config import RunConfig
from openeureka.errors import ConfigError
from openeureka.executors import EXECUTORS
from openeureka.executors.local import LocalExecutor
from openeureka.llm import open_model
from openeureka.plugins import Door
from openeureka.strategies import SEARCHES, Best, Eureka

CONFIG = RunConfig(sample=3)
MODULE = """
class Tournament:
    judge, peaks = "played", ("last",)

    def __init__(self, config):
        self.samples = config.sample

    def ask(self, history, rng): ...

    def tell(self, history, entries): ...


class Half:
    judge = "played"

    def __init__(self, config): ...


class Bare: ...


class Oracle:
    name, style, sample, close = "oracle", "free", None, None

    def __init__(self, config): ...


samples = 3
"""


@pytest.fixture(autouse=True)
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installed package with a search `tournament`, and one that calls itself `best`."""
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
        ("greedy", "There is no search `greedy`. It is best, eureka, tournament, or pkg.mod:Name of your own."),
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
        ("bracket:Half", "What `search=bracket:Half` makes is not complete: it has no peaks, ask, tell."),
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
