"""Tasks on which all episodes begin alike, searched again with policies that play with noise."""

import json
from pathlib import Path
from types import SimpleNamespace

import fresh
import pytest
import table
import with_noise

from openeureka.benchmark.plan import load


def test_nothing_but_the_noise_differs_from_the_table():
    again, first = load(with_noise.PLAN), load(table.PLAN)
    assert again.tasks == tuple(env for env in first.tasks if env in again.tasks), "in the order of the table"
    assert all(again.per_task[env] == first.per_task[env] for env in again.tasks)
    assert (again.settings, again.seeds, again.arms) == (first.settings, first.seeds, first.arms)


def test_all_its_tasks_begin_alike_and_no_other_of_the_table_was_played_with_noise():
    tasks = load(with_noise.PLAN).tasks
    assert len(tasks) == 14 and all(fresh.noisy(env) for env in tasks[::4])
    assert not fresh.noisy("shadow_hand_over")
    assert {env for env, row in with_noise.read(table.RESULTS).items() if table.noisy(row)} <= set(tasks)


@pytest.mark.parametrize("known", [{"noisy": True}, {}])
def test_the_human_reward_trains_again_only_where_it_played_without_noise(
    known: dict[str, object], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    before = {"human": [5.0, 6.0], "generated": [1.0, 1.0], "processor": "a fast one", "seeds": [4, 5], **known}
    (tmp_path / "table.json").write_text(json.dumps({"shadow_hand_pen": {"confirmed": before}}))
    monkeypatch.setattr(table, "RESULTS", tmp_path / "table.json")
    asked: list[list[str]] = []

    def trained(_: object, rewards: list[str], directory: Path, count: int) -> fresh.Trained:
        asked.append(rewards)
        return fresh.Trained([4, 5], [[float(len(reward)), 9.0] for reward in rewards], noisy=True)

    def archived_run(env: str, archive: Path = table.ARCHIVE) -> SimpleNamespace:
        source = "old" if archive == table.ARCHIVE else programs.pop()
        return SimpleNamespace(config=None, best=SimpleNamespace(program=SimpleNamespace(source=source)))

    monkeypatch.setattr(with_noise.headline, "search", lambda *_: (tmp_path / "store", {"crowned": "g0s1"}))
    monkeypatch.setattr(with_noise.headline, "put_away", lambda *_: None)
    monkeypatch.setattr(with_noise.headline, "archived_run", archived_run)
    monkeypatch.setattr(fresh, "trained", trained)
    programs = ["old", "newer"]
    row = with_noise.measure(load(with_noise.PLAN), "shadow_hand_pen")
    human = [5.0, 6.0] if known else [5.0, 9.0]  # the second is what `trained` gives a word of five letters
    assert row["confirmed"]["human"] == human and row["confirmed"]["generated"] == [5.0, 9.0]
    assert row["confirmed"].get("human_on") == ("a fast one" if known else None)
    assert asked == [["newer"] if known else ["human", "newer"]]
    row = with_noise.measure(load(with_noise.PLAN), "shadow_hand_pen")
    if known:
        assert row["confirmed"] == before and len(asked) == 1, "the same reward won"
    else:
        assert asked[1:] == [["human", "old"]]


def test_a_longer_training_of_a_row_is_not_taken_for_its_own():
    plain, longest = {"noisy": True, "human": [0.1]}, {"noisy": True, "steps": 3_000_000, "human": [0.4]}
    assert with_noise.played_with_noise({"shorter": [plain], "confirmed": longest}) == plain
    assert with_noise.played_with_noise({"confirmed": longest}) is None
    assert with_noise.played_with_noise({}) is None
