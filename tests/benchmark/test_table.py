"""The arithmetic of a comparison, against numbers worked out by hand."""

import pytest

from openeureka.benchmark.figures import Result
from openeureka.benchmark.plan import plan
from openeureka.benchmark.table import Comparison

PLAN = plan({"tasks": ["cartpole", "ant"], "seeds": [0, 10], "arms": {"full": {}, "random": {"model": "random"}}})


def result(task: str, arm: str, seed: int, held_out: float | None, **numbers) -> Result:
    known = {"search_steps": 100, "steps": 300, "human": 10.0, "sparse": 5.0, "cost_usd": 0.5, "minutes": 2.0}
    return Result(task=task, arm=arm, seed=seed, held_out=held_out, **{**known, "curve": (), **numbers})


def compared(*results: Result) -> Comparison:
    return Comparison(PLAN, results)


def decisions(table: Comparison) -> list[str]:
    by_task, _ = table.tables()
    column = by_task.titles.index("more than full") + 1
    return [row[column] for row in by_task.rows]


def test_arms_are_compared_with_the_first_seed_by_seed():
    table = compared(
        *(result("cartpole", "full", 0, 10.0), result("cartpole", "full", 1, 20.0)),
        *(result("cartpole", "random", 0, 8.0, steps=100), result("cartpole", "random", 1, 17.0)),
    )
    full, random, *rest = table.rows
    assert (full.held_out.value, full.seeds, full.difference) == (15.0, 2, None)
    # -2 and -3: mean -2.5, standard deviation 0.7071, t(1, 0.975) = 12.7062: the half-width is 6.3531.
    assert (random.difference.value, random.difference.low) == pytest.approx((-2.5, -8.8531), abs=1e-4)
    assert not random.difference.sure
    assert (random.steps, random.cost_usd, random.minutes) == (200, 1.0, 4.0)
    assert decisions(table) == ["", "not decided", "", ""]
    assert [(row.task, row.seeds, row.held_out) for row in rest] == [("ant", 0, None), ("ant", 0, None)]


def test_a_difference_that_is_larger_than_chance_is_decided():
    table = compared(
        *(result("cartpole", "full", seed, 10.0) for seed in (0, 1)),
        *(result("cartpole", "random", seed, 8.0 + seed / 10) for seed in (0, 1)),
    )
    # -2 and -1.9: standard deviation 0.0707, half-width 12.7062 * 0.0707 / sqrt(2) = 0.635.
    assert decisions(table) == ["", "decided", "", ""]


def test_scores_are_on_one_scale_for_a_task_and_clipped():
    # Human 10 and 14, sparse 5 and 3: F 12 scores 1 and F 4 scores 0. So 8 scores 0.5; 40 is clipped to 3, 0 to 0.
    table = compared(
        *(result("cartpole", "full", 0, 8.0), result("cartpole", "full", 1, 40.0, human=14.0, sparse=3.0)),
        result("cartpole", "random", 0, 0.0, human=None, sparse=None),
        *(result("ant", "full", 0, 7.5), result("ant", "random", 0, 10.0)),
    )
    assert [row.score for row in table.rows] == [1.75, 0.0, 0.5, 1.0]
    full, random = table.totals
    assert full.score == pytest.approx((0.5 + 3 + 0.5) / 3) and (full.cells, full.scored) == (3, 3)
    assert random.difference.value == pytest.approx((-0.5 + 0.5) / 2) and random.difference.count == 2


def test_arms_are_matched_at_the_steps_of_the_cheapest_of_the_seed():
    table = compared(
        result("cartpole", "full", 0, 9.0, search_steps=200, curve=((50, 1.0), (100, 4.0), (150, 7.0))),
        result("cartpole", "random", 0, 9.0, search_steps=120, curve=((60, 3.0),)),
        result("cartpole", "full", 1, 9.0, search_steps=90, curve=((90, 6.0),)),
    )
    full, random, *_ = table.rows
    assert (full.matched.value, random.matched.value) == (5.0, 3.0)  # full: 4 at 120 steps, 6 at 90


def test_a_search_that_trained_nothing_is_no_measure_and_is_not_hidden():
    table = compared(
        result("cartpole", "full", 0, 9.0, curve=((50, 1.0),)), result("cartpole", "random", 0, None, search_steps=0)
    )
    full, random, *_ = table.rows
    assert full.matched.value == 1.0 and random.held_out is None and random.difference is None
    assert table.tables()[0].rows[1][6] == "- (1 undefined)"
    assert compared(result("cartpole", "full", 0, None, search_steps=0)).rows[0].matched is None


def test_a_search_that_had_played_nothing_by_then_is_said_to_be_left_out():
    table = compared(
        *(result("cartpole", "full", seed, 9.0, search_steps=200, curve=((150, 7.0),)) for seed in (0, 1)),
        result("cartpole", "random", 0, 9.0, search_steps=120, curve=((60, 3.0),)),
    )
    by_task, _ = table.tables()
    matched = by_task.titles.index("F played, matched steps")
    # Seed 0 is matched at 120 steps, before full has played a reward. Seed 1 has only full: matched at its own 200.
    assert [row[matched] for row in by_task.rows[:2]] == ["7 (1 undefined)", "3"]
    assert "It has no interval, because all searches share its scale." in by_task.note


def test_a_first_arm_without_a_result_is_said_to_be_compared_with_nothing():
    alone = compared(result("cartpole", "full", 0, None), result("cartpole", "random", 0, 9.0)).tables()[0]
    assert "more than full" not in alone.titles and alone.note.endswith("the first arm, full, has no F held out.")
    begun = compared(result("cartpole", "full", 0, 9.0)).tables()[0]
    assert begun.note.endswith("Differences are paired by seed.")


def test_the_figure_has_a_panel_a_task_and_a_line_an_arm():
    table = compared(
        result("cartpole", "full", 0, 9.0, curve=((1_000_000, 2.0), (2_000_000, 4.0))),
        result("cartpole", "full", 1, 9.0, curve=((2_000_000, 6.0),)),
        result("cartpole", "random", 0, 9.0, curve=((4_000_000, 3.0),)),
    )
    (chart,) = table.figures()
    assert [(line.name, line.kind) for line in chart.lines] == [
        ("full", "steps"),
        ("random", "steps"),
        ("human reward, held out", "dashed"),
    ]
    # The mean begins at two million steps, where both seeds have a value, and goes on to the end of the figure.
    assert dict(zip(chart.xs, chart.lines[0].values, strict=True)) == {2.0: 5.0, 4.0: 5.0}
    assert list(compared().figures()) == []
    (without,) = compared(result("cartpole", "full", 0, 9.0, curve=((1e6, 2.0), (2e6, 3.0)), human=None)).figures()
    assert [line.name for line in without.lines] == ["full"]
