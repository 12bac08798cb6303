"""The tokens that a search takes from an endpoint, counted from archived searches."""

import headline
import longer
import tokens


def test_prompts_are_counted_once_a_generation_and_replies_each():
    # The prompts have 6,500, 10,787 and 13,507 characters, four per token.
    counted = list(tokens.rows("cartpole", headline.archived_run("cartpole", longer.ARCHIVE)))
    assert [row[:3] for row in counted] == [
        ("cartpole", "0", "1,625"), ("cartpole", "1", "2,697"), ("cartpole", "2", "3,377"),
    ]  # fmt: skip
    assert [row[3] for row in counted] == ["306", "489", "467"]
