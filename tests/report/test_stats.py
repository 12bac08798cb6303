from dataclasses import replace

import pytest

from openeureka.report.tables import by_generation, tiles, trained_share
from openeureka.types import Evaluation, Generation, History, VerdictCode

from .search import BASELINES, HISTORY, run, trained
from .test_verdict import ended


def test_a_generation_counts_slots_verdicts_replies_and_trained_slots():
    first = by_generation(HISTORY)[0]
    assert (first.slots, first.trained) == (3, 2)
    assert first.verdicts == {VerdictCode.ACCEPTED: 2, VerdictCode.REFUSED: 1}
    assert first.replies == 1 + 2 + 3
    assert (first.best, first.mean) == (30.0, 20.0)  # (10 + 30) / 2


def test_a_diverged_slot_counts_in_no_mean():
    second = by_generation(HISTORY)[1]
    assert (second.trained, second.best, second.mean) == (1, 20.0, 20.0)


def test_trained_share_is_of_all_slots():
    assert trained_share(HISTORY) == pytest.approx(4 / 6)
    assert trained_share(History()) is None


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
