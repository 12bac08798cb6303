import pytest

from openeureka.report.tables import by_generation, trained_share
from openeureka.types import History, VerdictCode

from .search import HISTORY


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
