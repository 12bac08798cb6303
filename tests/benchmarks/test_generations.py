"""The table of what later generations gain: each search is in it once, also one whose errors are zero."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import generations
import pytest

SEARCH = {"env": "ant", "model": "claude", "seed": 0, "steps": 1000, "sample": 8}


def search(first: tuple[float, float], later: tuple[float, float], **other: Any) -> dict[str, Any]:
    best = [{"place": f"g{g}s0", "fitness": f, "error": e} for g, (f, e) in enumerate((first, later))]
    return {**SEARCH, "best": best, "generated": [1.0, 2.0], "human": [1.0], **other}


def test_a_search_that_is_measured_again_is_in_the_table_once():
    old, other = search((1.0, 0.1), (2.0, 0.1)), search((1.0, 0.1), (2.0, 0.1), seed=1)
    new = search((1.0, 0.1), (2.0, 0.1), fresh={"generated": [1.0, 2.0], "human": [0.0, 1.0]})
    assert generations.joined([old, other], [new]) == [new, other]


def test_the_gain_is_told_by_its_error_where_there_is_one():
    assert "+5.0" in generations.rows([search((1.0, 3.0), (26.0, 4.0))])[0]
    assert "-" in generations.rows([search((0.0, 0.0), (1.0, 0.0))])[0]


def test_fresh_trainings_stay_with_the_reward_they_are_of():
    fresh = {"generated": [1.0, 2.0], "human": [0.0, 1.0]}
    known, again = search((1.0, 0.1), (2.0, 0.1), fresh=fresh), search((1.0, 0.1), (2.0, 0.1), date="today")
    assert generations.joined([known], [again]) == [{**again, "fresh": fresh}]
    other = search((1.0, 0.1), (3.0, 0.1))
    assert generations.joined([known], [other]) == [other]


def test_replies_of_another_search_of_a_task_have_a_file_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def keep(said: str, **settings: Any) -> list[str]:
        run = SimpleNamespace(config=SimpleNamespace(**{**SEARCH, **settings}), directory=said)
        generations.keep_replies(run)  # type: ignore[arg-type]
        return sorted(path.name for path in tmp_path.iterdir())

    monkeypatch.setattr(generations, "REPLIES", tmp_path)
    monkeypatch.setattr(generations, "read_replies", lambda said: [SimpleNamespace(text=said)])
    assert keep("one") == keep("one") == ["ant.json"]
    both = ["ant.json", "ant_gpt_5_1_1000_8.json"]
    assert keep("two", model="gpt-5", seed=1) == keep("two", model="gpt-5", seed=1) == both
    assert [json.loads((tmp_path / name).read_text())["replies"] for name in both] == [["one"], ["two"]]


def test_one_fresh_seed_is_refused_before_anything_trains():
    with pytest.raises(Exception, match="from 2 on"):
        generations.several("1")
    assert generations.several("2") == 2
