from dataclasses import replace

from openeureka.report.tables import generations, tiles
from openeureka.types import Evaluation, Generation, History, TrainingState

from .search import BASELINES, HISTORY, run, trained
from .test_verdict import ended


def test_a_generation_counts_slots_verdicts_replies_and_trained_slots():
    found = generations(run(HISTORY))
    first = dict(zip(found.titles, found.rows[0], strict=True))
    assert (first["slots"], first["trained"]) == ("3", "2")
    assert first["verdicts"] == "2 accepted, 1 refused"
    assert first["replies"] == "6"  # 1 + 2 + 3
    assert (first["best F"], first["mean F"]) == ("30", "20")  # (10 + 30) / 2
    assert first["environment steps"] == "200"  # 100 of each training
    assert found.note == "Of all slots, 67% trained."  # 4 of 6


def test_before_the_first_generation_no_share_trained():
    assert generations(run(History())).note == ""


def test_a_diverged_slot_without_a_score_counts_in_no_mean():
    assert generations(run(HISTORY)).rows[1][-4:] == ("1", "200", "20", "20")


def test_the_mean_of_a_generation_is_of_the_slots_that_its_best_is_one_of():
    """Of three slots, the one with 40 diverged, and the one with 10 breaks a limit, with falls of 0.9."""
    entries = [trained(0, slot, fitness) for slot, fitness in enumerate((40.0, 30.0, 10.0))]
    assert entries[0].result is not None
    entries[0] = replace(entries[0], result=replace(entries[0].result, state=TrainingState.DIVERGED))
    fallen = Evaluation(lane="x", fitness=10.0, episode_length=9.0, episodes=4, costs={"falls": 0.9})
    entries[2] = replace(entries[2], played=fallen)
    own = History((Generation(0, tuple(entries), limits={"falls": 0.5}),))
    assert generations(run(own)).rows[0][-4:] == ("2", "300", "40", "35")  # (40 + 30) / 2


def test_lanes_that_share_a_training_spend_its_steps_once():
    twins = (trained(0, 0, 10.0, source="same"), trained(0, 1, 10.0, source="same"))
    lanes = [entry.result for entry in (*twins, trained(0, 2, 5.0)) if entry.result is not None]
    history = History((Generation(0, (*twins, trained(0, 2, 5.0))),))
    said = tiles(run(history, [*lanes, *BASELINES]))
    assert [tile.more for tile in said if tile.name == "trainings"] == ["400 environment steps"]


def scored(generated: list[float], human: list[float]) -> dict[str, tuple[str, str]]:
    """The head of a run with these scores of fresh seeds, and a sparse reward that scores 0."""
    own = ended(generated, human)
    sparse = [Evaluation(lane=f"sparse-s{seed}", fitness=0.0, episode_length=9.0, episodes=4) for seed in (1, 2)]
    own = replace(own, evaluations={**own.evaluations, **{score.lane: score for score in sparse}})
    return {tile.name: (tile.value, tile.more) for tile in tiles(own)}


def test_the_head_shows_what_the_verdict_rests_on_and_a_score_only_where_it_is_decided():
    shown = scored([49.0, 51.0], [39.0, 41.0])
    assert shown["generated reward"] == ("50.0 ± 1.4", "F held out, 2 seeds") and "best F" not in shown
    assert shown["human reward"][0] == "40.0 ± 1.4"
    assert shown["score, held out"][0] == "1.25"  # 50 / 40
    assert "score, held out" not in scored([40.0, 42.0], [39.0, 41.0])
    before = [tile.name for tile in tiles(run(HISTORY, BASELINES))]
    assert "best F" in before and "generated reward" not in before


def test_a_candidate_with_the_program_of_an_earlier_one_is_its_twin():
    entries = (trained(0, 0, 10.0, source="same"), trained(0, 1, 5.0), trained(0, 2, 10.0, source="same"))
    own = run(History((Generation(0, entries),)))
    assert {str(place): str(first) for place, first in own.twins.items()} == {"g0s2": "g0s0"}
