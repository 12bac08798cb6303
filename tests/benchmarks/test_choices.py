"""How well a rung predicts fresh seeds, and schedules compared in the same searches, on scores made up here."""

import choices
import pytest
import rungs


def test_what_a_rung_tells_of_fresh_seeds_is_told_of_their_end() -> None:
    early, peaks, ends = (1.0, 2.0, 3.0), (30.0, 20.0, 10.0), (7.0, 8.0, 9.0)
    lanes = {
        f"{reward}-s{seed}": {"played": [one, peak, 0.0, 0.0, 0.0, end]}
        for reward, one, peak, end in zip("abc", early, peaks, ends, strict=True)
        for seed in (0, 1)
    }
    _, (*names, cells) = rungs.correlations({"ant": {"recipe": {"lanes": lanes}}})
    assert names == ["ant", "recipe", "fresh seeds"]
    assert cells == [pytest.approx(1.0), pytest.approx(-1.0), None, None, None, pytest.approx(1.0)]


def search(whole: float, early: float) -> choices.Search:
    """A search in which whole trainings choose a reward worth `whole`, and an eighth of a training one worth `early`.
    The best reward is worth 1."""
    worth = {"whole": whole, "early": early, "best": 1.0, "rest": -1.0 - whole - early}
    told = {reward: {1 / 8: float(reward == "early")} for reward in worth}
    return choices.Search(told, {reward: float(reward == "whole") for reward in worth}, worth)


def test_schedules_are_compared_search_by_search() -> None:
    searches = [search(0.9, 0.7), search(0.1, 0.0), search(-0.7, -1.0)]
    # 0.7, 0 and -1 have a standard error of 0.49. They are 0.2, 0.1 and 0.3 less than with whole trainings. The mean of
    # these differences has a standard error of 0.058; Student's t with two degrees of freedom is 4.3.
    cells = choices.compared(searches, choices.SCHEDULES["all end at 1/8"])
    assert cells == ("-0.1 ± 0.49", "-0.2 (-0.45 to 0.048)")
    assert choices.compared(searches, choices.SCHEDULES["`full`: all to the end"]) == ("0.1 ± 0.46", "-")
