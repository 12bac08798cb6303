"""The answers on the page of measurements say what the records say, whatever the outcome."""

import re
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import generations
import pen_spinning
import predictors
import prompts
import rungs
import verdicts

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "measurements.md"


def test_no_answer_quotes_a_figure_by_hand():
    by_hand = re.sub(r"<!-- ([\w: ]+) -->.*?<!-- /\1 -->", "", PAGE.read_text(), flags=re.DOTALL)
    bold = re.findall(r"\*\*([^*]+)\*\*", by_hand)
    assert len(bold) > 5 and not [words for words in bold if re.search(r"\d", words)]


def test_a_search_counts_where_a_later_generation_plays_better_than_the_first():
    scores = ((1.0, 2.0, 0.5), (1.0, 1.0), (2.0, 1.0))
    records = [{"best": [{"fitness": f} for f in fitness]} for fitness in scores]
    assert generations.summary(records).startswith("In 1 of 3 searches")


def test_the_verdict_in_use_is_the_one_that_is_told():
    row = {"sure": 0.04, "found": 0.5, "seeds": 3.0}
    rules = {"in use/3": [row, row | {"sure": 0.06}], "another/3": [row | {"sure": 1.0}]}
    said = verdicts.summary({"gap": 2.5, "rules": rules})
    assert "3 seeds, 5.0 % of races" in said and "6.0 % in the worst case" in said
    assert "2.5 standard deviations, 50.0 % of races find it." in said


def trained(**rewards: list[float]) -> dict[str, Any]:
    """A record with a reward for each F, grouped by advice."""
    lanes = {f"{advice}{n}-s0": {"fitness": f} for advice, own in rewards.items() for n, f in enumerate(own)}
    return {"rewards": {advice: [f"{advice}{n}" for n in range(len(own))] for advice, own in rewards.items()}} | {
        "lanes": lanes
    }


def test_advice_is_decided_where_chance_rarely_makes_such_a_difference_on_any_of_the_tasks():
    # Means 2 and 3, each of three values with variance 1: the standard error is sqrt(2 / 3), and t is 1.22 with four
    # degrees of freedom.
    said = prompts.summary({"ant": trained(a=[1.0, 2.0, 3.0], b=[2.0, 3.0, 4.0])})
    assert said.startswith("No difference is shown: 3 tasks are asked, so it takes p below 0.017.")
    assert said.endswith("On ant the difference is 1.2 times its standard error (p = 0.29).")
    # Means 2 and 4.5: t is 3.06 and p 0.038, which would be enough for a single task.
    assert prompts.summary({"ant": trained(a=[1.0, 2.0, 3.0], b=[3.5, 4.5, 5.5])}).startswith("No difference is shown")
    assert prompts.summary({"ant": trained(a=[1.0, 2.0, 3.0], b=[9.0, 10.0, 11.0])}).startswith("A difference is shown")


def test_rungs_are_told_by_the_highest_correlation_and_whole_trainings_by_both_ends(monkeypatch: pytest.MonkeyPatch):
    cells = ([0.1, None, 0.2, 0.3, 0.25, 0.6], [-0.5, -0.1, 0.0, 0.1, 0.1, 0.4])
    found = [("", "", title, own) for own in cells for title in (rungs.FRESH, "same lane")]
    monkeypatch.setattr(rungs, "correlations", lambda _: [*found, ("", "", "same lane", [1.0] * 6)])
    said = rungs.summary({})
    assert "is at most 0.1 for the first two rungs, at most 0.3 for the later ones, and 0.4 to 0.6 for whole" in said


@pytest.mark.parametrize(
    ("tasks", "said"),
    [
        (
            [0.5, 0.6, 0.7],
            "Something, over 3 tasks. After 1/4 of a training, F's rank correlation with the final score is 0.6 (0.35",
        ),
        (
            [-0.5, 0.6, 0.7],
            "Nothing certain, over 3 tasks. After 1/2 of a training, F's rank correlation with the final score is 0.27",
        ),
    ],
)
def test_curves_are_told_at_the_first_share_that_is_sure(
    tasks: list[float], said: str, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(predictors, "_columns", lambda task, _, place: (task if place > 1 else 0.0, None))
    monkeypatch.setattr(predictors, "spearman", lambda value, _: value)
    assert predictors.summary({str(n): value for n, value in enumerate(tasks)}).startswith(said)


def test_a_curriculum_helps_where_its_policy_spins_the_pen_more_often():
    arms = {
        name: {"cycles": cycles, "lanes": {"s0": {"curves": {"fitness": [None, best, 0.1]}}}}
        for name, cycles, best in (("pre_trained", 0.1, 9.0), ("fine_tuned", 0.2, 3.0), ("scratch", 0.3, 4.0))
    }
    found = {"env_steps": 1000, "seeds": 1, "arms": arms}
    assert pen_spinning.summary(found).startswith(
        "No, with 1,000 steps and one seed, which is no proof: after both stages the pen spins 0.2 times"
    )
    assert [row[2] for row in pen_spinning.rows(found)] == ["-", "3", "4"]
    arms["fine_tuned"]["cycles"] = 0.4
    assert pen_spinning.summary(found | {"seeds": 3}).startswith("Yes, with 1,000 steps and 3 seeds: after")
