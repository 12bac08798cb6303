"""What the documentation tells a person to type: commands and settings exist, and examples are accepted."""

import re
import shlex
from pathlib import Path

import pytest

from openeureka.cli.main import app
from openeureka.cli.settings import (
    BenchConfig,
    CheckConfig,
    ContextConfig,
    DoctorConfig,
    ExportConfig,
    NewConfig,
    PageConfig,
    PlayConfig,
    ReportConfig,
    split,
)
from openeureka.cli.tasks import check
from openeureka.config import RunConfig, TrainConfig, TuneConfig
from openeureka.types import RemarkKind

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
KINDS = {
    "run": RunConfig,
    "resume": RunConfig,
    "train": TrainConfig,
    "tune": TuneConfig,
    "bench": BenchConfig,
    "check": CheckConfig,
    "play": PlayConfig,
    "report": ReportConfig,
    "context": ContextConfig,
    "doctor": DoctorConfig,
    "new": NewConfig,
    "export": ExportConfig,
    "ui": PageConfig,
}
COMMANDS = {info.callback.__name__ for info in app.registered_commands if info.callback}


def command_lines() -> list[tuple[str, str]]:
    """(page, words after `eureka`) of every indented or quoted command line."""
    pattern = re.compile(r"(?:^ {4}(?:\S*/)?|`)eureka ([a-z][^`\n]*)", re.MULTILINE)
    return [(page.name, found) for page in PAGES for found in pattern.findall(page.read_text())]


@pytest.mark.parametrize(("page", "line"), command_lines())
def test_documented_commands_and_settings_exist(page, line):
    command, *words = shlex.split(line.partition("   ")[0], comments=True)  # after three spaces comes an explanation
    assert command in COMMANDS
    keys = {word.partition("=")[0] for word in split([w for w in words if not w.startswith("--")])[0]}
    known = set(RemarkKind) if command == "feedback" else set(KINDS[command].__dataclass_fields__) if keys else set()
    assert keys <= known | ({"python"} if "env" in known else set())  # `python=PATH` becomes a part of `env`


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    code = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.+)$", code, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_pages_link_to_files_and_headings_that_exist():
    links = [(page, *link) for page in PAGES for link in re.findall(r"\]\(([^)#:]*)(#[^)]+)?\)", page.read_text())]
    aims = [(page.parent / file if file else page, anchor) for page, file, anchor in links]
    assert [str(aim) for aim, _ in aims if not aim.exists()] == []
    assert [f"{aim}{anchor}" for aim, anchor in aims if anchor and anchor[1:] not in anchors(aim)] == []
    assert len(links) > 5


@pytest.mark.parametrize("path", sorted((ROOT / "examples").glob("*_reward.py")), ids=lambda path: path.stem)
def test_example_rewards_are_accepted(path):
    assert check([f"env={path.stem.removesuffix('_reward')}", str(path)]) == 0


def test_the_guide_shows_the_example_as_it_is():
    code = (ROOT / "examples" / "cartpole_reward.py").read_text().split('"""\n\n')[1]
    assert f"```python\n{code}```" in (ROOT / "docs" / "guides" / "your-own-reward.md").read_text()


def test_the_readme_shows_lines_of_a_reward_as_a_model_wrote_them():
    shown = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    assert shown is not None
    lines = [line.strip() for line in shown[1].splitlines() if line.strip()]
    replies = [path.read_text() for path in (ROOT / "benchmarks" / "found").glob("*.md")]
    assert len(lines) >= 10
    assert any(all(line in reply for line in lines) for reply in replies)
