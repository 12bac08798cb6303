import dataclasses
import re
from pathlib import Path

from openeureka.report import html
from openeureka.report.view import RunView
from openeureka.testing.scripted import reply
from openeureka.types import Generation, History

from .page import words
from .scripted import search_in
from .search import BASELINES, HISTORY, finished, refused, run


def report(run: RunView) -> str:
    return words(html.report(run, Path("nowhere")))


def test_the_report_opens_with_the_verdict_of_the_final_scores():
    head, *_ = report(finished()).split("## ")
    # 44 and 48 against 58 and 60: the pooled spread is sqrt((8 + 2 + 0) / 2) = 2.24, the difference -13.
    assert "The generated reward is worse than the human one: F 46 (2 seeds) against 59 (2 seeds)" in head
    assert "It pays for" not in head and "Its components: $upright." in head


def test_the_search_comes_second_under_a_name_that_says_what_it_is():
    search = report(finished()).split("The search\n")[1]
    assert re.search(r"\| highest, g\ds\d \| 50 \|", search)
    assert "| human reward | 60 |" in search
    assert "| sparse reward | 20 |" in search
    assert "compare rewards by the final scores" in search


def test_the_final_scores_are_means_over_fresh_seeds():
    text = report(finished())
    assert "Mean ± standard deviation over seeds." in text
    # 46 and 50: mean 48, sample deviation sqrt(8) = 2.8; two less when held out.
    assert "| best generated | 46.0 ± 2.8 | 48.0 ± 2.8 | 2 |" in text
    assert "| sparse | 18 (1 undefined) | 20 (1 undefined) | 2 |" in text
    assert "held out | 0.683 |" in text  # (46 - 18) / (59 - 18)


def test_what_follows_the_sign_of_a_played_score_is_said_to_be_its_error():
    note = "± here, and of single candidates: standard error over episodes."
    assert note in report(dataclasses.replace(finished(), ranks="played"))
    assert note not in report(finished())  # nothing was played


def test_an_unfinished_run_says_what_is_missing():
    assert "Not decided yet: the final trainings are not done." in report(run(HISTORY, BASELINES))
    assert "No reward has been trained yet." in report(run(History((Generation(0, (refused(0, 0, "x"),)),))))


def test_the_report_has_a_row_per_generation_and_the_best_source():
    text = report(run(HISTORY, BASELINES))
    assert "| 0 | 3 | 2 accepted, 1 refused | 6 | 2 | 200 | 30 | 20 |" in text
    assert "def compute_reward(x):\n    return x, {}\n" in text
    assert "Of all slots, 67% trained." in text  # 4 of 6
    assert "1200 prompt tokens and 340 completion tokens, US$ 0.0125" in text


def test_the_report_holds_every_candidate_with_its_diff_prompts_and_replies(tmp_path):
    replies = [reply(7), "```python\ndef compute_reward(x):\n    return x\n```", reply(8), reply(9)]
    text = report(RunView.read(search_in(tmp_path / "run", replies, iteration=2)))
    flat = " ".join(text.split())
    assert "Generation 0, slot 0 trained F 6" in flat
    assert "Generation 0, slot 1 refused" in flat
    assert "line 1: nothing is returned [no-number]; return a number" in text
    assert "-    return 7" in text and "+    return 8" in text
    assert "Here is the reward." in text and "Do the thing." in text
