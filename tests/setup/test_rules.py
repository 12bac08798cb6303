"""What CONTRIBUTING says about the code as a whole is true."""

import ast
import functools
import subprocess
import sys
from pathlib import Path

import openeureka

PACKAGE = Path(openeureka.__file__).parent


def users(*names: str) -> set[str]:
    """Modules that import or call one of these, by dotted name."""
    return {
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*.py")
        if any(said == name or said.startswith(f"{name}.") for said in _said(path) for name in names)
    }


@functools.cache
def _said(path: Path) -> set[str]:
    said: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            said |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            said |= {f"{node.module}.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            said.add(f"{node.value.id}.{node.attr}")
    return said


def test_sockets_are_opened_by_models_the_page_and_the_viewer():
    opens = users("socket", "http", "urllib.request", "httpx2", "openai", "huggingface_hub", "uvicorn", "mujoco.studio")
    assert {name for name in opens if name.split("/")[0] not in ("llm", "ui")} == {"film/web.py"}


SEARCH = """
import importlib, pkgutil, sys
from pathlib import Path

import openeureka.strategies
from openeureka.config import RunConfig
from openeureka.events import nobody
from openeureka.loop import run
from openeureka.store import Store
from openeureka.testing.scripted import TOY, ScriptedModel, ToyChecker, ToyDesk, ToyTrainer, reply

for module in pkgutil.walk_packages(openeureka.strategies.__path__, "openeureka.strategies."):
    importlib.import_module(module.name)
config = RunConfig(sample=2, iteration=2, seeds=1, baselines="train")
with Store.open(Path(sys.argv[1]), config) as store:
    model = ScriptedModel([reply(3.0), reply(8.0), reply(12.0), reply(4.0)])
    strategy = openeureka.strategies.make(config)
    outcome = run(config, store, model, ToyChecker(), ToyTrainer(), TOY, strategy, nobody, ToyDesk())
print(outcome.best.fitness, sorted({"torch", "mujoco", "warp"} & set(sys.modules)))
"""


def test_a_search_of_fakes_needs_neither_torch_nor_a_simulator(tmp_path: Path):
    command = [sys.executable, "-c", SEARCH, str(tmp_path / "run")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.stdout == "12.0 []\n", done.stdout + done.stderr[-2000:]


def test_a_script_hides_no_folder_of_tests():
    """Both are imported by their bare names, so which one is found would depend on which tests run."""
    tests = Path(__file__).parents[1]
    scripts = {path.stem for folder in ("benchmarks", "scripts") for path in (tests.parent / folder).glob("*.py")}
    assert scripts & {path.name for path in tests.iterdir() if path.is_dir()} == set()
