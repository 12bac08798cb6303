"""What it costs a policy to observe only what sensors measure, from the records of tasks."""

import measurable


def found(everything: list[float], sensed: list[float]) -> dict[str, object]:
    return {"steps": 1000, "held_out": {"all": everything, "measurable": sensed}}


def test_a_row_has_the_difference_its_interval_and_its_share():
    ((task, steps, before, after, interval, share),) = measurable.rows({"ant": found([4.0] * 4, [3.0] * 4)})
    assert (task, steps, before, after) == ("ant", "1,000", "4 ± 0", "3 ± 0")
    assert (interval, share) == ("-1 (-1 to -1)", "-25%")


def test_of_a_negative_score_less_is_a_loss_too():
    ((*_, share),) = measurable.rows({"anymal": found([-0.5, -0.5], [-0.6, -0.6])})
    assert share == "-20%"


def test_one_seed_has_no_interval():
    ((*_, interval, _),) = measurable.rows({"humanoid": found([4.0], [3.0])})
    assert interval == "-"
