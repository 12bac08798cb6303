"""Longer searches on the tasks where the table's reward ended below the human one, from the same first replies."""

import json
from pathlib import Path
from types import SimpleNamespace

import longer
import pytest
import table

from openeureka.benchmark.plan import load
from openeureka.llm.replay import archived
from openeureka.stats import mean


def test_it_goes_on_where_the_table_ended_below_the_human_reward_with_the_same_eight():
    whole, short = load(longer.PLAN), load(table.PLAN)
    known = longer.read(table.RESULTS)
    for cell in whole.cells():
        row = table.decided(known[cell.task])
        assert mean(row["generated"]) < mean(row["human"]), cell.task
        (first,) = (other for other in short.cells() if other.task == cell.task)
        config, before = whole.config(cell), short.config(first)
        replies, eight = (archived(Path(one.model.removeprefix("replay:"))) for one in (config, before))
        assert [reply.text for reply in replies[:8]] == [reply.text for reply in eight], cell.task
        assert len(replies) == 24 == config.sample * config.iteration and config.steps == before.steps


def test_what_it_found_is_judged_with_seeds_that_chose_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    run = SimpleNamespace(best=SimpleNamespace(program=SimpleNamespace(source="mine")), config=None)
    asked: list[object] = []

    def trained(_: object, rewards: list[str], directory: Path, count: int) -> object:
        asked.extend((rewards, directory.name, count))
        return longer.fresh.Trained([4, 5], [[1.0, 2.0], [3.0, 5.0]], noisy=False)

    monkeypatch.setattr(
        longer.headline, "search", lambda *_: (tmp_path / "store", {"generated": [9.0], "steps": 1, "crowned": "g1s0"})
    )
    monkeypatch.setattr(longer.headline, "put_away", lambda *_: None)
    monkeypatch.setattr(longer.headline, "archived_run", lambda *_: run)
    monkeypatch.setattr(longer.fresh, "trained", trained)
    row = longer.measure(load(longer.PLAN), "ant")
    assert asked == [["human", "mine"], "ant", 9]
    assert row["generated"] == [9.0], "the race's scores are kept, but do not decide"
    assert row["confirmed"]["generated"] == [3.0, 5.0] and row["confirmed"]["difference"][0] == 2.5
    monkeypatch.setattr(longer, "RESULTS", tmp_path / "longer.json")
    (tmp_path / "longer.json").write_text(json.dumps({"ant": row}))
    assert longer.left({"ant": row}) == [task for task in load(longer.PLAN).tasks if task != "ant"]
    ((task, *_, human, apart, ending, crowned),) = longer.rows({"ant": row})
    assert (task, human, ending, crowned) == ("ant", "1.50 ± 0.71", "level", "g1s0") and apart.startswith("2.5 (")
    apart = {"generated": [1.0, 2.0, 3.0], "human": [4.0, 5.0, 6.0], "difference": [-3.0, -5.27, -0.73]}
    (told,) = longer.rows({"ant": row | {"confirmed": row["confirmed"] | apart}})
    assert told[-2] == "level", "worse if asked alone, but four tasks are asked"
    assert (
        longer.summary({"ant": row})
        == "After three generations, the generated reward is at or above the human one on 1 of 1 tasks."
    )
    lost = row | {"confirmed": row["confirmed"] | {"generated": [1.0, 1.5]}}
    assert "on 1 of 2 tasks" in longer.summary({"ant": row, "anymal": lost})
