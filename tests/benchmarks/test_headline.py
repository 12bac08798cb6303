"""Each row of the headline table ends as its numbers say, and every task has its replies stored."""

import json
import lzma
import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import NoReturn

import headline
import pytest
import table
from records import read, write

from openeureka import strategies
from openeureka.benchmark.plan import load
from openeureka.config import RunConfig
from openeureka.events import nobody
from openeureka.llm.replay import archived
from openeureka.method import race
from openeureka.method.lanes import Lanes
from openeureka.score import SeedScores
from openeureka.store import Store
from openeureka.store.db import FILENAME
from openeureka.tasks import registry
from openeureka.types import LaneSpec, TrainBudget

ROOT = Path(__file__).parents[2]


def row(generated: list[float], human: list[float], difference: list[float] | None) -> dict[str, object]:
    return {
        "steps": 1000,
        "generated": generated,
        "human": human,
        "sparse": [0.0],
        "runners_up": {},
        "difference": difference,
        "score": 1.5,
        "correlation_with_human": 0.5,
    }


def test_a_row_ends_as_its_interval_says():
    found = {
        "better": row([3.0, 4.0], [1.0, 2.0], [2.0, 0.5, 3.5]),
        "worse": row([1.0], [3.0], [-2.0, -3.0, -1.0]),
        "level": row([1.0, 2.0], [2.0, 0.5], [0.25, -1.0, 1.5]),
        "one seed": row([2.0], [1.0], None),
        "nothing learnt": row([0.0, 0.0], [0.0, 0.0], [0.0, 0.0, 0.0]),
    }
    assert [table.ending(one) for one in found.values()] == list(found)


def test_a_tie_of_policies_that_are_no_better_than_untrained_ones_is_no_draw():
    own = row([0.02, 0.01, 0.03], [0.01, 0.02, 0.02], [0.003, -0.01, 0.02]) | {"seed": 0}

    def ending(untrained: list[float], *, noisy: bool = False, **changed: object) -> str:
        return table.ending(own | {"untrained": {"seeds": [0, 1, 2], "scores": untrained, "noisy": noisy}} | changed)

    assert table.ending(own) == ending([0.0, 0.0, 0.001]) == "level"
    assert ending([0.02, 0.01, 0.02]) == "nothing learnt"
    assert ending([0.02, 0.01, 0.02], human=[0.5, 0.6, 0.7]) == "level", "the human reward's policies learn"
    assert ending([0.02, 0.01, 0.02], noisy=True) == "level", "they did not play as the row's policies"
    assert ending([0.02, 0.01, 0.02], difference=[0.003, 0.001, 0.02]) == "better", "one did harm, the other did not"
    again = {"seeds": [7, 8, 9], "generated": [0.5, 0.6, 0.7], "human": [0.4, 0.6, 0.7], "difference": [0.0, -0.1, 0.1]}
    later = own | {"confirmed": again | {"noisy": True}}
    later |= {"untrained": {"seeds": [7, 8, 9], "scores": [0.0, 0.1, 0.2], "noisy": True}}
    assert table.ending(later) == "level" and table.gains({"ant": later})
    assert not table.beginners(later | {"confirmed": None}), "the race had other seeds, and so other start states"
    first, second = table.rows({"ant": later})
    assert (first[5], second[5]) == ("-", "0.10 ± 0.10")
    told = {tuple(line[4:]) for line in table.data({"ant": later | {"crowned": "g0s0"}})}
    assert ("untrained", "", "8", "0.1") in told


def test_seeds_that_could_not_decide_are_no_draw():
    own = row([1.0, 0.0, 1.0], [0.0] * 4, [0.67, 0.0, 1.33]) | {"runners_up": {"g0s1": [0.0, 1.0, 1.0]}}
    assert table.ending(own) == "too few seeds", "with a rival, even 3 of 3 against 0 of 4 may be chance"
    assert table.ending(own | {"runners_up": {}}) == "level", "without a rival, it would not be chance"
    assert table.ending(own | {"generated": [0.5, 0.25, 1.0]}) == "level", "F has more than two values"
    rival = {"generated": [1.0] * 3, "human": [1.0, 0.5, 1.0, 1.0], "runners_up": {"g0s1": [0.5, 1.0, 1.0]}}
    assert table.ending(own | rival) == "too few seeds", "any two values count as 0 and 1 do"
    more = {"generated": [1.0] * 9, "human": [0.0, 1.0] * 4 + [1.0], "difference": [0.4, 0.0, 0.8]}
    assert table.ending(own | {"confirmed": more}) == "level"
    assert "level on 0, worse on 0. On 1, three seeds are too few to tell" in table.summary({"ant": own})
    assert table.endings({"ant": own}) == [
        ("not decided: three seeds are too few to tell", "1"),
        ("not measured yet", str(len(load(table.PLAN).tasks) - 1)),
    ]


def test_where_the_two_rewards_trained_on_two_kinds_of_processor_the_page_says_so():
    alike = {"date": "2026-01-02", "processor": "A"}
    again = {"date": "2026-01-03", "processor": "B", "generated_on": "A"}
    told = table.measured_on({"ant": alike | {"confirmed": again}})
    assert "A for the generated reward, B for the human one: 1" in told and "- A: 1" in told


def test_a_tie_of_zeros_is_no_draw():
    zeros = row([0.0, 0.0], [0.0, 0.0], [0.0, 0.0, 0.0])
    measured = {"ant": row([3.0, 4.0], [1.0, 2.0], [2.0, 0.5, 3.5]), "shadow_hand_kettle": zeros}
    told = table.summary(measured)
    assert "better than the human one on 1 of them, level on 0, worse on 0." in told
    assert "worse on 0. On 1, neither reward is shown to do better than no training." in told
    assert "On 1 more tasks the same seeds" in told and told.endswith("on 1, equal on 0, below on 0.")
    measured |= {"anymal": row([1.0, 2.0], [2.0, 1.0], [0.0, -1.0, 1.0]), "cartpole": row([2.0], [1.0], None)}
    told = table.summary(measured)
    assert told.endswith(
        "On 3 more tasks the same seeds picked the reward and score it. There it is "
        "above the human one's on 2, equal on 1, below on 0."
    )
    assert "On 1 it is not known, as one seed trained." in told
    measured = {env: measured[env] for env in ("ant", "shadow_hand_kettle")}
    links = [f"[{name}](../../benchmarks/headline/rewards/{name}.py)" for name in ("ant", "shadow_hand_kettle")]
    assert [line[0] for line in table.rows(measured)] == links


def test_seeds_that_chose_nothing_decide_a_row_and_stand_below_it():
    again = {"seeds": [7, 8], "generated": [1.0, 3.0], "human": [2.0, 6.0], "difference": [-2.0, -3.0, -1.0]}
    own = {**row([3.0, 4.0], [1.0, 2.0], [2.0, -0.5, 4.5]), "confirmed": again}
    first, second = table.rows({"ant": own})
    assert table.ending(own) == "worse" and "worse on 1" in table.summary({"ant": own})
    told = table.summary({"ant": own})
    assert "1 tasks trained again" in told and "above the human one's on 0, equal on 0, below on 1. On 0 more" in told
    assert first[0].startswith("[ant](") and "level" in first and "3.5" in first[2]
    assert second[0] == "ant, 2 other seeds" and "worse" in second and "-2 (-3 to -1)" in second
    assert (first[-3:-1], second[-3:-1]) == (["2.33", "2.33"], ["0.5", "0.5"])  # divided by the human mean: 1.5, and 4
    assert table.gains({"ant": own}) == [("ant", "worse", -0.5, -0.75, -0.25)]
    unreached = {**row([3.0, 4.0], [0.0, 0.0], [3.5, 1.75, 5.25]), "confirmed": None}
    assert table.gains({"ant": unreached}) == [("ant", "better", 1.0, 0.5, 1.5)], "a win over F 0 has a bar too"


def test_the_longest_trainings_decide_a_row_and_shorter_ones_stay_in_the_table():
    short = {"seeds": [7, 8], "generated": [0.0, 0.0], "human": [0.0, 0.0], "difference": [0.0, 0.0, 0.0]}
    more = {"generated": [3.0, 4.0], "human": [1.0, 2.0], "difference": [2.0, 0.5, 3.5]}
    longer = {"steps": 3000, "seeds": [7, 8], **more}
    own = row([0.0, 0.0], [0.0, 0.0], [0.0, 0.0, 0.0]) | {"crowned": "g0s0", "seed": 0, "shorter": [short]}
    own |= {"confirmed": longer, "untrained": {"seeds": [7, 8], "noisy": False, "scores": [0.0, 0.0]}}
    lines = table.rows({"ant": own})
    assert [(line[1], line[7]) for line in lines] == [
        ("1,000", "nothing learnt"),
        ("", "nothing learnt"),
        ("3,000", "better"),
    ]
    assert lines[1][4] == "0" and lines[2][4] == "-", "the sparse reward trained as long as the row, not longer"
    assert table.ending(own) == "better" and "better than the human one on 1 of them" in table.summary({"ant": own})
    told = [tuple(line[1:3]) for line in table.data({"ant": own}) if line[4] == "generated"]
    assert told == [("1000", "race")] * 2 + [("1000", "other")] * 2 + [("3000", "other")] * 2
    assert {line[3] for line in table.data({"ant": own})} == {"no"}, "none of them played with noise"


def test_a_row_that_is_known_trains_again_only_for_more_steps(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    again = {"seeds": [4, 5], "generated": [1.0, 3.0], "human": [2.0, 6.0], "difference": [-2.0, -3.0, -1.0]}
    results, asked = tmp_path / "headline.json", list[int]()

    def train_other_seeds(env: str, count: int, steps: int) -> dict[str, object]:
        asked.append(steps)
        return again | {"steps": steps}

    monkeypatch.setattr(table, "RESULTS", results)
    monkeypatch.setattr(headline, "train_other_seeds", train_other_seeds)
    write(results, {"cartpole": row([1.0], [1.0], None) | {"confirmed": again}})
    for steps in (0, 1000, 3000, 0, 2000, 9000):
        headline.confirm("cartpole", 2, steps)
    known = read(results)["cartpole"]
    assert asked == [3000, 9000] and known["confirmed"]["steps"] == 9000
    assert known["shorter"] == [again, again | {"steps": 3000}], "what was measured is kept"


def test_a_row_whose_policies_played_without_noise_cannot_be_repeated():
    with pytest.raises(SystemExit, match="without noise.* benchmarks/headline/rewards/shadow_hand_block_stack.py"):
        headline.repeat(load(table.PLAN), "shadow_hand_block_stack")


@pytest.mark.parametrize("env", ["shadow_hand_kettle", "shadow_hand_door_open_inward"])
def test_a_row_decided_by_seeds_that_play_with_noise_repeats_these(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, env: str
):
    row = headline.read(table.RESULTS)[env]
    known = row["confirmed"]

    def trained(config: RunConfig, rewards: Sequence[str], directory: Path, count: int) -> headline.fresh.Trained:
        steps = known.get("steps", row["steps"])
        assert (config.env, config.steps, directory, count) == (env, steps, tmp_path / env, 9)
        assert rewards == ["human", table.reward_file(env).read_text()]
        assert not directory.exists(), "else a repetition that is done would be told again"
        return headline.fresh.Trained(known["seeds"], [known["human"], known["generated"]], noisy=True)

    (tmp_path / env).mkdir()
    (tmp_path / env / "report.html").touch()
    monkeypatch.setattr(headline, "AGAIN", tmp_path)
    monkeypatch.setattr(headline.fresh, "trained", trained)
    told = headline.repeat(load(table.PLAN), env)
    assert told == f"{env}, 9 other seeds: every number is the same to the bit."


def test_a_reward_of_the_table_trains_again_beside_the_human_one(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    monkeypatch.setattr(headline, "CONFIRMED", tmp_path)
    held = headline.fresh.trained
    monkeypatch.setattr(
        headline.fresh,
        "trained",
        lambda config, *rest: held(replace(config, steps=20_000, worlds=32), *rest),
    )
    again = headline.train_other_seeds("cartpole", 2)
    assert again["seeds"] == [4, 5], "the search trained with 0, its final trainings with 1 to 3"
    assert "steps" not in again, "those of the row"
    assert len(again["generated"]) == len(again["human"]) == 2 and again["difference"]
    assert (tmp_path / "cartpole").is_dir()
    assert "noisy" not in again and "noisy" in headline.confirmation(
        headline.fresh.Trained([1, 2], [], noisy=True), [1, 2], [3, 4]
    )


def test_a_training_without_a_score_is_told_and_not_left_out(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    run = headline.archived_run("cartpole")
    given = {"human": SeedScores(held_out=(1.0, 2.0)), "mine": SeedScores(held_out=(3.0, None))}
    view = SimpleNamespace(config=run.config, directory=tmp_path, view=SimpleNamespace(given=given))
    monkeypatch.setattr(headline.fresh.openeureka, "train", lambda *_, **__: view)
    with pytest.raises(SystemExit, match="1 of 2 trainings of mine have no held-out score"):
        headline.fresh.trained(run.config, ["human", "mine"], tmp_path, 2)


def test_every_task_has_eight_replies_and_a_budget():
    whole = load(table.PLAN)
    assert sorted(whole.tasks) == sorted(registry.names())
    for cell in whole.cells():
        config = whole.config(cell)
        assert config.steps and config.sample == len(archived(Path(config.model.removeprefix("replay:")))) == 8


def test_what_is_left_is_what_is_not_measured():
    every = headline.left({}).splitlines()
    assert len(every) == 1 + len(load(table.PLAN).tasks)
    assert len(headline.left({"ant": {}}).splitlines()) == len(every) - 1


def test_a_repetition_is_the_same_or_says_what_is_not():
    kept = {**row([3.0, 4.0], [1.0], None), "minutes": 3.0, "date": "", "device": "2 cores", "versions": {"torch": "2"}}
    later = {**kept, "minutes": 9.0, "date": "later", "device": "4 cores"}
    kept |= {"confirmed": {"seeds": [7, 8]}, "untrained": {"seeds": [7, 8]}}  # what a search does not measure
    assert headline.compared("ant", kept, later) == "ant: every number is the same to the bit."
    text = headline.compared("ant", kept, {**later, "human": [1.0000001]})
    assert "not the same" in text and "human: [1.0000001], the table has [1.0]" in text and "generated:" not in text


def test_the_figure_shows_what_is_decided_beyond_one():
    zeros = row([0.0, 0.0], [0.0, 0.0], [0.0, 0.0, 0.0])
    level = row([1.0, 2.0], [2.0, 0.5], [0.25, -0.75, 1.25])
    better = row([3.0, 4.0], [0.0, 0.0], [3.0, 1.0, 5.0])
    shown = table.novelty({"shadow_hand_kettle": zeros, "anymal": level, "ant": better})
    assert shown == [("ant", "better", 0.5, 1.5), ("anymal", "level", 0.5, 0.25)]
    ones, apart = row([1.0, 1.0], [1.0, 1.0], [0.0, 0.0, 0.0]), row([1.0, 1.0], [0.0, 0.0], [1.0, 1.0, 1.0])
    # Every seed scores the same: without a spread, only a difference of 0 is shown.
    assert table.novelty({"ant": ones, "anymal": apart}) == [("ant", "too few seeds", 0.5, 0.0)]


def test_eureka_s_rule_looks_at_training_alone():
    import greedy  # pyright: ignore[reportMissingImports]

    run = headline.archived_run("ballbalance")
    entries = run.history.entries
    first = max(entries, key=lambda entry: entry.result.fitness if entry.result else -1e9)
    assert greedy.greedy(run.history) == replace(first, played=None) and first.sample.place != run.crown
    same = {"best": "g0s1", "eureka": "g0s1"}
    other = same | {"own": [2.0, 3.0], "other": [0.0, 1.0], "difference": [2.0, 0.5, 3.5]}
    waits = {"best": "g0s1", "eureka": "g0s2"}
    told = greedy.summary({"ant": same, "anymal": other, "humanoid": waits, "quadcopter": waits})
    assert told.startswith("On 1 of ") and told.endswith(
        "better on 1 tasks, worse on 0 and level on 0. On 2 tasks the seeds are not trained yet."
    )
    assert not greedy.waits(greedy.named("shadow_hand_switch"))  # all eight are equal: the first leads by both rules
    assert greedy.waits(greedy.named("shadow_hand_swing_cup"))
    assert [row[0] for row in greedy.rows({"ant": same, "anymal": other})] == ["anymal"]


def test_an_archived_run_names_its_replies_as_any_clone_has_them():
    for path in table.ARCHIVE.glob("*.sqlite.xz"):
        replies = Path(headline.archived_run(path.name.removesuffix(".sqlite.xz")).config.model.removeprefix("replay:"))
        assert not replies.is_absolute() and (headline.ROOT / replies).is_file(), path.name


def test_what_is_archived_says_nothing_of_where_it_was_measured(tmp_path: Path, monkeypatch):
    (tmp_path / FILENAME).write_bytes(lzma.decompress((table.ARCHIVE / "anymal.sqlite.xz").read_bytes()))
    monkeypatch.setattr(headline, "ROOT", Path("replay:benchmarks"))  # the part to strip from the file's name
    kept = headline.portable(tmp_path / FILENAME)
    assert b"replay:benchmarks/" not in kept and b"headline/anymal.json" in kept
    (tmp_path / FILENAME).write_bytes(kept)
    with pytest.raises(sqlite3.IntegrityError, match="never changes"), sqlite3.connect(tmp_path / FILENAME) as database:
        database.execute("UPDATE run SET version = ''")


class Idle:
    """A trainer that must not be called: all that a race needs is archived."""

    def train(self, env: str, lanes: Sequence[LaneSpec], budget: TrainBudget) -> NoReturn:
        raise AssertionError(f"not archived: {', '.join(lane.id for lane in lanes)}")

    def evaluate(self, env: str, policies: Mapping[str, bytes], **options: object) -> NoReturn:
        raise AssertionError(f"never played: {', '.join(policies)}")

    rewards = evaluate


@pytest.mark.parametrize("env", sorted(json.loads((ROOT / "benchmarks" / "results" / "headline.json").read_text())))
def test_a_race_of_today_crowns_what_the_table_says(env: str, tmp_path: Path):
    """Fails if the race's rule has changed since a row was measured: such a row has to be measured again."""
    (tmp_path / FILENAME).write_bytes(lzma.decompress((table.ARCHIVE / f"{env}.sqlite.xz").read_bytes()))
    with Store.view(tmp_path) as known:
        config = known.config
    with Store.open(tmp_path, config) as store:
        strategy = strategies.make(store.config)
        lanes = Lanes(store.config, store, Idle(), nobody, strategy.ranks, strategy.peaks)
        best = race.crown(store.history(), lanes)
        scores = store.lanes.evaluations()
        ends = race.outcome(config, store.history(), store.crown(), store.lanes.results(), scores, {})
    row = headline.read(table.RESULTS)[env]
    assert best is not None and str(best.sample.place) == row["crowned"]
    assert best.sample.candidate is not None
    assert table.reward_file(env).read_text() == best.sample.candidate.source
    assert ends.difference is not None
    assert [ends.difference.value, ends.difference.low, ends.difference.high] == pytest.approx(row["difference"])
    ids = {"generated": best.candidate_id, "human": "human", "sparse": "sparse"}
    raced = [cells for cells in table.data({env: row}) if cells[2] == "race" and cells[4] in ids]
    for _, _, _, _, reward, _, seed, score in raced:
        played = scores.get(f"{ids[reward]}-s{seed}")
        known = played.fitness if played is not None else None
        assert score == ("" if known is None else repr(known)), f"the data names another seed for {reward}, {seed}"


def test_every_score_of_the_table_is_a_line_of_its_data():
    again = {"seeds": [4, 5], "generated": [0.25, None], "human": [0.5, 0.125], "noisy": True}
    own = row([3.0, 4.0], [1.0, 2.0, 1.5], None) | {"crowned": "g0s2", "seed": 0, "runners_up": {"g0s1": [2.5]}}
    lines = table.data({"cartpole": own | {"confirmed": again}})
    assert all(len(cells) == len(table.COLUMNS) for cells in lines)
    assert [",".join(cells[2:]) for cells in lines] == [
        "race,no,generated,g0s2,1,3.0",
        "race,no,generated,g0s2,2,4.0",
        "race,no,runner-up,g0s1,1,2.5",
        "race,no,human,,0,1.0",
        "race,no,human,,1,2.0",
        "race,no,human,,2,1.5",
        "race,no,sparse,,0,0.0",
        "other,yes,generated,g0s2,4,0.25",
        "other,yes,generated,g0s2,5,",
        "other,yes,human,,4,0.5",
        "other,yes,human,,5,0.125",
    ]
