"""The dot plot of a verdict."""

import pytest

from openeureka.report import dots, html

from .page import words
from .search import HISTORY, run
from .test_verdict import ended


def test_two_rewards_stand_on_one_axis_with_the_interval_of_their_difference():
    # Means 50 and 40; the difference is 10 +- 6.09 (see test_verdict). Its bar is drawn from the human mean, 40: from
    # 43.91 to 56.09. The axis adds an 18th of 39 to 56.09 at either end: 38.05 to 57.04, 18.99 wide.
    plot = dots.of(ended([49.0, 51.0], [39.0, 41.0]))
    assert plot is not None and plot.word == "better"
    generated, human = plot.rows
    assert generated.mean == pytest.approx(62.9, abs=0.1) and human.mean == pytest.approx(10.3, abs=0.1)
    assert plot.bar == (pytest.approx(30.9, abs=0.1), pytest.approx(95.0, abs=0.1))
    assert plot.bar[0] > human.mean  # the difference is sure, so its bar does not reach the human mean
    assert [x for x, _ in human.seeds] == [pytest.approx(5.0, abs=0.1), pytest.approx(15.5, abs=0.1)]
    assert [text for _, text in plot.ticks] == ["40", "45", "50", "55"]


@pytest.mark.parametrize(
    ("generated", "human", "word"),
    [
        ([39.0, 41.0], [49.0, 51.0], "worse"),
        ([40.0, 42.0], [39.0, 41.0], "not decided"),
        ([41.0], [40.0], "not decided"),
        ([1.0, 1.0], [1.0, 1.0, 1.0], "no difference"),
        ([41.0], [], None),
        ([None, None], [40.0, 41.0], None),
        ([1e40, 2.0], [1.0, 2.0], None),
    ],
)
def test_it_says_in_a_word_what_the_verdict_says_and_is_none_where_that_compares_none(generated, human, word):
    plot = dots.of(ended(generated, human))
    assert (plot.word if plot is not None else None) == word
    if plot is not None:
        assert (plot.bar is None) is (len(generated) < 2)


def test_equal_scores_stand_below_each_other():
    plot = dots.of(ended([1.0, 1.0], [1.0, 1.0, 1.0]))
    assert plot is not None and plot.rows[1].seeds == ((50.0, 0), (50.0, 1), (50.0, 2)) and plot.most == 2
    assert [text for _, text in plot.ticks] == ["0.9", "0.95", "1", "1.05", "1.1"]


def test_the_report_shows_it_above_the_sentence(tmp_path):
    page = html.report(ended([40.0, 42.0], [39.0, 41.0]), tmp_path)
    assert page.index('<figure class="seeds"') < page.index("<b>Not decided: F 41 (2 seeds)")
    assert 'aria-label="F held out. generated: 40, 42. human: 39, 41."' in page
    assert "not decided" in words(page)


def test_a_search_that_is_not_over_has_none():
    assert dots.of(run(HISTORY)) is None
