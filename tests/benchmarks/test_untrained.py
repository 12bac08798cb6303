"""Policies that never trained play as those that decide a row of the table."""

import table
import untrained


def test_they_play_the_episodes_of_the_seeds_that_decide_a_row():
    row = {"seed": 0, "generated": [9.0, 8.0, 9.0], "human": [9.0] * 4, "difference": [-0.3, -1.0, 0.4]}
    race = untrained.measure("cartpole", row, episodes=4)
    assert race["seeds"] == [0, 1, 2, 3, 4, 5] and not race["noisy"] and min(race["scores"]) > 0.0
    again = row | {"confirmed": {"seeds": [3, 4], "generated": [9.0], "human": [9.0], "noisy": True}}
    other = untrained.measure("cartpole", again, episodes=4)
    assert other["seeds"] == [3, 4] and other["noisy"] and other["scores"] != race["scores"][3:5]
    assert table.beginners(row | {"untrained": race}) == race["scores"]
    assert list(untrained.left({"cartpole": row, "ant": row | {"untrained": race}})) == ["cartpole"]
    assert list(untrained.left({"cartpole": again | {"untrained": race}})) == ["cartpole"], "now other seeds decide it"
