from openeureka.config import RunConfig
from openeureka.report.markdown import report
from openeureka.types import Evaluation, Generation, History, Usage

from .search import BASELINES, HISTORY, refused, trained


def written(history: History = HISTORY) -> str:
    held_out = {"best-s1": Evaluation(job="best-s1", fitness=48.5, episode_length=499.0, episodes=64)}
    usage = Usage(prompt_tokens=1200, completion_tokens=340, cost_usd=0.0125)
    return report(RunConfig(env="cartpole"), history, BASELINES, held_out, usage)


def test_the_report_opens_with_the_best_reward_against_the_baselines():
    head = written().split("## ")[0]
    assert "| best generated reward | 50 |" in head
    assert "| human reward | 60 |" in head
    assert "| human-normalised score of the best | 0.75 |" in head


def test_the_report_has_a_row_per_generation_and_the_best_source():
    text = written()
    assert "| 0 | 3 | 2 accepted, 1 refused | 6 | 2 | 30 | 20 |" in text
    assert "```python\ndef compute_reward(x):\n    return x, {}\n```" in text
    assert "| best-s1 | 48.5 | 499 | 64 |" in text
    assert "1200 prompt tokens and 340 completion tokens, US$ 0.0125" in text


def test_what_a_model_wrote_cannot_leave_its_cell_or_its_fence():
    hostile = History(
        (
            Generation(
                0,
                (
                    trained(0, 0, 1.0, source='x = 1\n"""\n```\n# not a heading\x1b[31m'),
                    refused(0, 1, "a | b <img src=x> [link](http://x)\n# heading\u202e"),
                ),
            ),
        )
    )
    text = written(hostile)
    assert "````python\n" in text and "\x1b" not in text and "\u202e" not in text
    assert "a \\| b \\<img src=x> \\[link](http://x) # heading" in text


def test_a_search_without_a_trained_reward_says_so():
    assert "No reward has been trained yet." in written(History((Generation(0, (refused(0, 0, "x"),)),)))
