import pytest

from openeureka.report.tables import by_generation, tiles, trained_share
from openeureka.types import Generation, History, VerdictCode

from .search import BASELINES, HISTORY, run, trained


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
