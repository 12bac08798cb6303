"""A bench from the first cell to the table, with fakes for model, sandbox and trainer."""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import pytest
import yaml

import openeureka
from openeureka.benchmark import bench, figures
from openeureka.benchmark.plan import Cell
from openeureka.cli import main as command
from openeureka.config import RunConfig
from openeureka.errors import ConfigError, EurekaError, ModelError, StoreError, TaskError
from openeureka.ui import folder

from .toys import PLAN, MeteredModel, lines, play


@pytest.fixture(autouse=True)
def meters(tmp_path, monkeypatch) -> Path:
    play(monkeypatch, tmp_path)
    return tmp_path


def run(tmp_path: Path, plan: dict, *words: str) -> int:
    (tmp_path / "plan.yaml").write_text(yaml.safe_dump(plan, sort_keys=False))
    with pytest.raises(SystemExit) as exit:
        command.main(["bench", f"{tmp_path}/plan.yaml", f"dir={tmp_path}/bench", *words])
    return int(exit.value.code or 0)


def test_a_bench_says_what_each_arm_spent_and_found(tmp_path, meters):
    found = openeureka.bench(PLAN, dir=tmp_path / "bench")
    assert found.finished and not found.failures
    full, weaker = found.rows
    # A toy's F is the number that its program returns plus seed / 100; F held out is one less. The final trainings
    # have the seeds 1 and 2, or 11 and 12. So their means are 11.015 and 11.115, and 5.015 and 5.115.
    assert full.held_out.value == pytest.approx(11.065) and weaker.held_out.value == pytest.approx(5.065)
    # The difference is exactly -6 with both seeds, and two values without a spread decide nothing.
    assert weaker.difference.value == pytest.approx(-6.0) and not weaker.difference.sure
    # A training takes three steps. Each search has two candidates; those of the weak model are the same graph, which
    # trains once. Then come the human and the sparse reward, and two final seeds of the best and of the human one.
    assert (full.search_steps, weaker.search_steps) == (6, 3)
    assert (full.steps, weaker.steps) == (6 + 6 + 12, 3 + 6 + 12)
    assert len(lines(meters, "trained")) * 3 == 2 * (full.steps + weaker.steps)
    # Matched at the weak model's three steps: there the strong model's first candidate has played 7 and 7.1.
    assert full.matched.value == pytest.approx(7.05) and weaker.matched.value == pytest.approx(5.05)
    assert full.cost_usd == pytest.approx(2 * 2 * 0.01)
    assert [(total.arm, total.cells) for total in found.totals] == [("full", 2), ("weaker", 2)]
    # Human F is 9 + seed / 100 with the seeds 0 to 2 and 10 to 12: mean 9.06. Sparse F is 4 and 4.1: mean 4.05.
    human = (9.0 + 9.01 + 9.02 + 9.1 + 9.11 + 9.12) / 6
    assert full.score == pytest.approx((11.065 - 4.05) / (human - 4.05))


def test_cells_are_ordinary_runs_and_the_page_has_a_table_and_a_panel(tmp_path):
    openeureka.bench(PLAN, dir=tmp_path / "bench")
    names = {f"cartpole-{arm}-{seed}" for arm in ("full", "weaker") for seed in (0, 10)}
    assert set(folder.runs(tmp_path / "bench")) == names  # what `eureka ui` lists
    assert all(openeureka.open_run(tmp_path / "bench" / name).finished for name in names)
    page = (tmp_path / "bench" / "bench.html").read_text()
    assert "4 of 4 searches are finished" in page and page.count("data-chart=") == 1 and "decided" in page
    rows = json.loads((tmp_path / "bench" / "bench.json").read_text())["rows"]
    assert [(row["arm"], row["seeds"]) for row in rows] == [("full", 2), ("weaker", 2)]
    reports = re.findall(r'href="(cartpole-[^"]*)"', page)
    assert len(reports) == 4 and all((tmp_path / "bench" / report).is_file() for report in reports)


def test_its_file_says_of_what_plan_it_is_and_when_and_with_what_each_cell_ran(tmp_path, monkeypatch):
    def written() -> dict:
        return json.loads((tmp_path / "bench" / "bench.json").read_text())

    def ran(version: str) -> dict:
        return {"date": "2026-11-28", "device": "cpu", "versions": {"torch": version}}

    monkeypatch.setattr(bench, "_conditions", lambda config: ran("1"))
    one = {**PLAN, "arms": {"full": PLAN["arms"]["full"]}}
    openeureka.bench(one, dir=tmp_path / "bench")
    assert written()["begun"] == {f"cartpole-full-{seed}": ran("1") for seed in (0, 10)}
    assert written()["plan"]["arms"] == one["arms"] and written()["plan"]["settings"]["sample"] == 2
    monkeypatch.setattr(bench, "_conditions", lambda config: ran("2"))
    openeureka.bench(PLAN, dir=tmp_path / "bench")
    found = written()["begun"]
    assert found["cartpole-full-0"] == ran("1"), "it is read, not run again"
    assert found["cartpole-weaker-0"] == ran("2")
    monkeypatch.undo()
    assert set(bench._conditions(RunConfig(device="cuda"))) == {"date", "device", "versions"}


def test_one_arm_is_compared_with_none(tmp_path):
    alone = {**PLAN, "arms": {"full": PLAN["arms"]["full"]}}
    by_task, over_tasks = openeureka.bench(alone, dir=tmp_path / "bench").compared.tables()
    assert "" not in by_task.titles and "more than full" not in (*by_task.titles, *over_tasks.titles)
    assert all(len(row) == len(table.titles) for table in (by_task, over_tasks) for row in table.rows)
    assert "paired" not in by_task.note


def test_what_is_finished_is_read_and_not_run_again(tmp_path, meters):
    first = openeureka.bench(PLAN, dir=tmp_path / "bench")
    before = lines(meters, "trained"), lines(meters, "asked")
    (tmp_path / "bench" / "cartpole-full-0" / "report.html").unlink()  # as if killed before the report
    again = openeureka.bench(PLAN, dir=tmp_path / "bench")
    assert (lines(meters, "trained"), lines(meters, "asked")) == before
    assert again.rows == first.rows
    assert (tmp_path / "bench" / "cartpole-full-0" / "report.html").is_file()


def test_another_plan_may_have_other_arms_and_changes_no_cell_that_is_there(tmp_path, meters):
    openeureka.bench(PLAN, dir=tmp_path / "bench")
    before = Counter(lines(meters, "trained"))
    arms = {**PLAN["arms"], "again": {"model": "strong"}}
    found = openeureka.bench({**PLAN, "arms": arms}, dir=tmp_path / "bench")
    assert found.rows[2].difference.value == 0.0 and not found.rows[2].difference.sure
    assert {line.split()[0] for line in Counter(lines(meters, "trained")) - before} == {
        "cartpole-again-0",
        "cartpole-again-10",
    }
    before = lines(meters, "asked")
    fewer = openeureka.bench({**PLAN, "arms": {"full": PLAN["arms"]["full"]}}, dir=tmp_path / "bench")
    assert fewer.finished and [row.arm for row in fewer.rows] == ["full"]
    changed = {"first": {"model": "strong"}, "full": {"model": "strong", "sample": 4}}
    with pytest.raises(StoreError, match=r"cartpole-full-0 holds .* sample=4 \(was 2\).*delete its folder"):
        openeureka.bench({**PLAN, "arms": changed}, dir=tmp_path / "bench")
    assert lines(meters, "asked") == before, "refused before the first cell ran"


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"search": "bset"}, "There is no search `bset`. Did you mean `best`?"),
        ({"init": "missing.py"}, "Cannot read the reward file .*missing.py"),
        ({"limits": "heat=9"}, "`cartpole` has no cost `heat` to limit"),
        ({"randomise": "soft"}, "There are no ranges `soft`"),
        ({"curriculum": "soft"}, "`cartpole` has no curriculum `soft`"),
        ({"executor": "cloud"}, "There is no executor `cloud`"),
        ({"device": "gpu"}, "There is no device `gpu`"),
    ],
)
def test_an_arm_that_cannot_run_is_refused_before_another_has_trained(tmp_path, meters, settings, says):
    arms = {**PLAN["arms"], "last": {"model": "strong", **settings}}
    with pytest.raises(EurekaError, match=says):
        openeureka.bench({**PLAN, "arms": arms}, dir=tmp_path / "bench")
    assert not lines(meters, "asked") and not (tmp_path / "bench").exists()


def test_a_cell_that_failed_with_a_mistyped_model_begins_anew_without_its_folder(tmp_path, monkeypatch):
    asked = MeteredModel.sample

    def unknown(self, prompt, *, n, seed):
        if self.name.startswith("wek-"):
            raise ModelError("The endpoint has no model wek.")
        return asked(self, prompt, n=n, seed=seed)

    monkeypatch.setattr(MeteredModel, "sample", unknown)
    typed = {**PLAN, "arms": {**PLAN["arms"], "weaker": {"model": "wek"}}}
    assert len(openeureka.bench(typed, dir=tmp_path / "bench").failures) == 2
    for seed in PLAN["seeds"]:
        with pytest.raises(StoreError, match=f"cartpole-weaker-{seed} holds .* model=weak .was wek."):
            openeureka.bench(PLAN, dir=tmp_path / "bench")
        shutil.rmtree(tmp_path / "bench" / f"cartpole-weaker-{seed}")
    assert openeureka.bench(PLAN, dir=tmp_path / "bench").finished


def test_nothing_is_made_for_what_cannot_be(tmp_path):
    with pytest.raises(TaskError, match="Did you mean `cartpole`"):
        openeureka.bench({**PLAN, "tasks": ["cartpol"]}, dir=tmp_path / "bench")
    assert not (tmp_path / "bench").exists()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("...")
    with pytest.raises(ConfigError, match="is not empty and holds no bench"):
        openeureka.bench(PLAN, dir=tmp_path / "full")


def test_an_arm_that_fails_says_so_and_the_others_go_on(tmp_path, capsys):
    arms = {"keyless": {"model": "keyless"}, **PLAN["arms"]}
    assert run(tmp_path, {**PLAN, "seeds": [0], "arms": arms}) == 3  # the exit code of ModelError
    out = capsys.readouterr().out
    assert "cartpole-keyless-0 could not be finished: The endpoint refused the key; check OPENAI_API_KEY." in out
    assert "Cell 3 of 3: cartpole-weaker-0" in out
    found = json.loads((tmp_path / "bench" / "bench.json").read_text())
    assert [(row["arm"], row["seeds"]) for row in found["rows"]] == [("keyless", 0), ("full", 1), ("weaker", 1)]
    assert list(found["failed"]) == ["cartpole-keyless-0"] and not found["finished"]
    assert "cartpole-keyless-0 could not be finished" in (tmp_path / "bench" / "bench.html").read_text()


def test_a_cell_that_cannot_be_read_stops_no_other(tmp_path, capsys):
    plan = {**PLAN, "seeds": [0]}
    assert run(tmp_path, plan) == 0
    (tmp_path / "bench" / "cartpole-full-0" / "run.sqlite").write_bytes(b"no database" * 100)
    assert run(tmp_path, plan) != 0
    found = json.loads((tmp_path / "bench" / "bench.json").read_text())
    assert list(found["failed"]) == ["cartpole-full-0"]
    assert [(row["arm"], row["seeds"]) for row in found["rows"]] == [("full", 0), ("weaker", 1)]


def test_a_cell_killed_at_its_first_rows_runs_again(tmp_path):
    cell = tmp_path / "bench" / "cartpole-full-0"
    plan = {**PLAN, "seeds": [0]}
    openeureka.bench(plan, dir=tmp_path / "bench")
    shutil.rmtree(cell)
    cell.mkdir()
    (cell / "run.sqlite").touch()
    found = openeureka.bench(plan, dir=tmp_path / "bench")
    assert found.finished and not found.failures


def test_the_command_prints_a_table_and_ctrl_c_says_how_to_go_on(tmp_path, meters, capsys, monkeypatch):
    seen = figures.read

    def interrupted(cell: Cell, directory: Path):
        if cell.arm == "weaker" and directory.exists():
            raise KeyboardInterrupt
        return seen(cell, directory)

    with monkeypatch.context() as patch:
        patch.setattr(figures, "read", interrupted)
        assert run(tmp_path, PLAN) == 130
    command = f"eureka bench {tmp_path}/plan.yaml dir={tmp_path}/bench"
    assert capsys.readouterr().err.splitlines() == [f"Stopped, nothing is lost. Continue with: {command}"]
    before = Counter(lines(meters, "trained"))
    assert run(tmp_path, PLAN) == 0
    assert max((before + (Counter(lines(meters, "trained")) - before)).values()) == 1
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("cartpole  ")]
    assert [row[1] for row in rows] == ["full", "weaker"]


def test_a_killed_bench_goes_on_and_neither_asks_nor_trains_twice():
    script, memory = Path(__file__).with_name("killed.py"), "/dev/shm"  # its processes sync every write
    with tempfile.TemporaryDirectory(dir=memory if os.access(memory, os.W_OK) else None) as folder:
        command = [sys.executable, script, folder, "31"]
        said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    report = json.loads(said.splitlines()[-1])
    assert len(report["killed"]) >= 3
    assert all(left == report["whole"] for left in report["killed"])
    assert set(Counter(report["whole"]["trained"]).values()) == {1}
