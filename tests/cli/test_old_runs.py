"""A run that an older version left: schema 3, killed while its second generation trained."""

from __future__ import annotations

import tarfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest

from openeureka.cli.main import main
from openeureka.executors.local import LocalExecutor
from openeureka.report.candidates import CandidateState
from openeureka.report.view import RunView
from openeureka.store import Store
from openeureka.types import Evaluation, Place
from openeureka.ui import pages

ARCHIVE = Path(__file__).parent / "runs" / "schema3.tar.xz"


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(tmp_path / "run", filter="data")
    return tmp_path / "run"


def eureka(*words: str) -> int:
    with pytest.raises(SystemExit) as exit:
        main(words)
    return int(exit.value.code or 0)


def test_it_is_shown(directory: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert eureka("show", str(directory)) == 0
    shown = capsys.readouterr().out
    assert "Generation 0: best F in training 38.55, 2 of 2 trained" in shown and "1 of 2 generations are done." in shown
    assert eureka("report", str(directory), "video=none") == 0
    assert "Made from" not in (directory / "report.html").read_text()  # `model=random` read no parent
    assert "0 of 2 generations" not in str(pages.overview(directory, RunView.read(directory)))


def test_what_it_did_not_keep_is_worked_out_once(directory: Path) -> None:
    with Store.view(directory) as store:
        roles = {name: lane.role for name, lane in store.lanes.all().items()}
        parents, attempts = store.talk.parents(), store.attempts()
    first, second = "6e0cbd02bc12", "b2396fcd5172"
    assert roles == {
        f"{first}-s0": "candidate",
        f"{second}-s0": "candidate",
        "human-s0": "baseline",
        "sparse-s0": "baseline",
    }
    # F 38.55 against 18: the prompt of the second generation shows the first slot's program.
    assert parents == {Place(1, 0): Place(0, 0), Place(1, 1): Place(0, 0)}
    found = {place: attempt.candidate.id for place, attempt in attempts.items() if attempt.candidate}
    assert found[0, 0, 0] == first and found[0, 0, 1] == second and len(found) == 4


class Brief(LocalExecutor):
    """Plays few episodes: a held-out score takes as long as these trainings."""

    def evaluate(self, env: str, policies: Mapping[str, bytes], **options: Any) -> Iterator[Evaluation]:
        return super().evaluate(env, policies, **{**options, "episodes": 4})


@pytest.mark.timeout(300)  # six processes begin one after the other
def test_it_goes_on_where_it_was(directory: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("openeureka.executors.local.LocalExecutor", Brief)
    before = RunView.read(directory)
    assert [c.state for c in before.candidates][2:] == [CandidateState.ACCEPTED] * 2
    assert eureka("resume", str(directory), "threads=1", f"trust={directory}") == 0
    after = RunView.read(directory)
    assert all(c.state is CandidateState.TRAINED for c in after.candidates)
    assert after.outcome is not None and after.ranks == "training"
    # What was there is as it was; what trains now says what this processor makes of it.
    known = [c.fitness for c in after.candidates]
    assert known[:2] == [c.fitness for c in before.candidates][:2] == pytest.approx([38.55, 18.0], abs=0.01)
    assert None not in known and None not in after.outcome.method.training
    assert len(after.outcome.method.training) == after.config.seeds
    assert {lane.role for name, lane in after.lanes.items() if name not in before.lanes} == {"candidate", "final"}
